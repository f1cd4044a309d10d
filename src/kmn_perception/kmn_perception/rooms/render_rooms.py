"""Render random rooms with a door in a wall, as a depth camera with a grey image sees them."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
from tqdm import tqdm

from kmn_perception.command_line.arguments import output_folder, whole_number, write_json
from kmn_perception.configuration.section import ConfigurationError
from kmn_perception.model.camera import Camera
from kmn_perception.rooms.label import label
from kmn_perception.rooms.rendering import render_room
from kmn_perception.rooms.sampling import sample_room
from kmn_perception.rooms.settings import RoomSettings

QUALITY = 95  # of the JPEG


def write(folder: Path, seed: int, camera: Camera, sensor: str, settings: RoomSettings) -> None:
    """Write images and label of the room of a seed."""
    name = f"room_{seed}"
    room = sample_room(seed, camera, settings)
    images = render_room(room, settings.image, np.random.default_rng([seed, 1]))
    depth = np.nan_to_num(np.rint(1e3 * images.depth)).astype(np.uint16)
    grey = [cv2.IMWRITE_JPEG_QUALITY, QUALITY]
    for file, image, options in (("d.png", depth, []), ("colour.jpg", images.grey, grey)):
        if not cv2.imwrite(str(folder / f"{name}_{file}"), image, options):
            raise OSError(f"{folder / name}_{file} cannot be written")
    write_json(folder / f"{name}.json", label(room, images.depth, name, seed, sensor))


def arguments(command: Sequence[str] | None = None) -> argparse.Namespace:
    """Parse the command line."""
    parser = argparse.ArgumentParser(prog="render_rooms", description=__doc__)
    parser.add_argument("--out", type=output_folder, required=True, help="folder to write to")
    parser.add_argument("--count", type=whole_number(1), default=10, help="rooms (default 10)")
    parser.add_argument("--seed", type=whole_number(0), default=0, help="of the first room")
    parser.add_argument("--sensor", default="d455", help="of config/cameras (default d455)")
    return parser.parse_args(command)


def main() -> int:
    """Run the executable ``render_rooms``."""
    options = arguments()
    try:
        settings, camera = RoomSettings.load(), Camera.load(options.sensor)
        options.out.mkdir(parents=True, exist_ok=True)
        for seed in tqdm(range(options.seed, options.seed + options.count), unit="room"):
            write(options.out, seed, camera, options.sensor, settings)
    except (ConfigurationError, OSError) as error:
        print(f"render_rooms: {error}", file=sys.stderr)
        return 1
    return 0
