"""Render random rooms with a door in a wall, as a depth camera with a grey image sees them."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from tqdm import tqdm

from kmn_perception.command_line.arguments import output_folder, whole_number, write_json
from kmn_perception.configuration.section import ConfigurationError
from kmn_perception.model.noisy_sensor import SENSORS
from kmn_perception.rooms.frame import CALIBRATIONS, Frame, make_frame
from kmn_perception.rooms.label import label
from kmn_perception.rooms.sampling import KINDS

QUALITY = 95  # of the JPEG


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
    return parser.parse_args(command)


def main(command: Sequence[str] | None = None) -> int:
    """Run the executable ``render_rooms``."""
    options = arguments(command)
    source = {key: getattr(options, key) for key in ("sensor", "calibration", "kind")}
    try:
        options.out.mkdir(parents=True, exist_ok=True)
        for seed in tqdm(range(options.seed, options.seed + options.count), unit="room"):
            frame = make_frame(seed, **source)
            write(options.out, f"{options.kind}_{seed}", frame, {"seed": seed, **source})
    except (ConfigurationError, OSError) as error:
        print(f"render_rooms: {error}", file=sys.stderr)
        return 1
    return 0
