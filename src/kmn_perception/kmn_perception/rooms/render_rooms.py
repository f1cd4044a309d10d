"""Render random rooms with a door in a wall, as a depth camera with a grey image sees them."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from tqdm import tqdm

from kmn_perception.command_line.arguments import output_folder, whole_number, write_json
from kmn_perception.configuration.section import Section
from kmn_perception.model.noisy_sensor import SENSORS
from kmn_perception.rooms.frame import CALIBRATIONS, Frame, make_frame
from kmn_perception.rooms.label import label
from kmn_perception.rooms.sampling import KINDS
from kmn_perception.sharing.experiment import add_jobs, add_shard
from kmn_perception.sharing.processes import in_order

QUALITY = 95  # of the JPEG
HOW = ("sensor", "calibration", "kind")  # a room is rendered, beside its seed
WORTHWHILE = 20  # rooms of a process; for fewer its start, some seconds, does not pay


def write(folder: Path, name: str, frame: Frame, source: dict[str, Any]) -> None:
    """Write images and label of a frame."""
    depth = np.nan_to_num(np.rint(1e3 * frame.depth)).astype(np.uint16)
    grey = [cv2.IMWRITE_JPEG_QUALITY, QUALITY]
    measured = "raw.png" if source["calibration"] == "raw" else "d.png"
    for ending, image, options in ((measured, depth, []), ("colour.jpg", frame.images.grey, grey)):
        if not cv2.imwrite(str(folder / f"{name}_{ending}"), image, options):
            raise OSError(f"{folder / name}_{ending} cannot be written")
    write_json(folder / f"{name}.json", label(frame, name, source))


def arguments(command: Sequence[str] | None = None) -> argparse.Namespace:
    """Parse the command line."""
    parser = argparse.ArgumentParser(prog="render_rooms", description=__doc__)
    parser.add_argument("--out", type=output_folder, required=True, help="folder to write to")
    parser.add_argument("--count", type=whole_number(1), default=10, help="rooms (default 10)")
    parser.add_argument("--seed", type=whole_number(0), default=0, help="of the first room")
    parser.add_argument(
        "--sensor", choices=("none", *SENSORS.values()), default="d455", help="default d455"
    )
    parser.add_argument(
        "--calibration", choices=CALIBRATIONS, default="calibrated", help="default calibrated"
    )
    parser.add_argument(
        "--kind", choices=KINDS, default="door", help="what is in the wall (default door)"
    )
    add_jobs(parser)
    add_shard(parser)
    return parser.parse_args(command)


def missing(options: argparse.Namespace) -> list[int]:
    """Return the seeds of the shard's rooms that are not rendered yet.

    Raises
    ------
    ValueError
        If a room of another rendering has the name of one of them.
    """
    seeds = []
    for i in options.shard.items(options.count):
        seed = options.seed + i
        file = options.out / f"{options.kind}_{seed}.json"  # is written last
        if not file.is_file():
            seeds.append(seed)
            continue
        there = Section.load_json(file).section("source").values
        if not _source(options, seed).items() <= there.items():
            raise ValueError(f"{file} is of a room rendered with other options; use another --out")
    return seeds


def _source(options: argparse.Namespace, seed: int) -> dict[str, Any]:
    return {"seed": seed, **{key: getattr(options, key) for key in HOW}}


class Rendering:
    """Renders rooms, and writes them to a folder."""

    def __init__(self, options: argparse.Namespace) -> None:
        self._options = options

    def __call__(self, seed: int) -> None:
        """Render the room of a seed."""
        source = _source(self._options, seed)
        frame = make_frame(**source)
        write(self._options.out, f"{self._options.kind}_{seed}", frame, source)


def main(command: Sequence[str] | None = None) -> int:
    """Run the executable ``render_rooms``; rooms that are there are not rendered again."""
    options = arguments(command)
    try:
        options.out.mkdir(parents=True, exist_ok=True)
        seeds = missing(options)
        done = in_order(partial(Rendering, options), seeds, options.jobs, WORTHWHILE)
        for _ in tqdm(done, total=len(seeds), unit="room"):
            pass
    except (ValueError, OSError) as error:
        print(f"render_rooms: {error}", file=sys.stderr)
        return 1
    return 0
