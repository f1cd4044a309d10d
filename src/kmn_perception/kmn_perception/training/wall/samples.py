"""Samples to train on: what is seen of the walls of rendered rooms, and what is to be found."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kmn_perception.doors.settings import DoorSettings
from kmn_perception.doors.view_cells import cells_of
from kmn_perception.doors.walls import Frame, NoWallError, find_walls
from kmn_perception.rooms.frame import make_frame
from kmn_perception.training.wall.settings import DataSettings, WallTrainingSettings
from kmn_perception.training.wall.targets import Target, target_of

SCALE = 127.0  # cells of -1 to 1 are kept as whole numbers


class Sample(NamedTuple):
    """A view of a wall.

    Attributes
    ----------
    cells
        (CHANNELS, ROWS, N) of ``SCALE``.
    """

    cells: NDArray[np.int8]
    target: Target


def samples_of(index: int, settings: WallTrainingSettings, doors: DoorSettings) -> list[Sample]:
    """Return the samples of a room of the endless sequence that a seed stands for."""
    # Far from the small seeds of rooms that others judge by.
    seeds = np.random.SeedSequence((settings.seed, index)).generate_state(2)
    generator = np.random.default_rng(seeds[0])
    data = settings.data
    kind, sensor, calibration = (
        _draw(generator, weights) for weights in (data.kinds, data.sensors, data.calibrations)
    )
    try:
        frame = make_frame(int(seeds[1]), sensor, kind, calibration)
    except RuntimeError:  # no place for the camera was found
        return []
    depth = np.nan_to_num(frame.depth).astype(np.float32)
    grey = frame.images.grey.astype(np.float32) / np.float32(255.0)
    try:
        seen = Frame(depth, grey, frame.room.camera)
        walls = find_walls(seen, doors, generator)
    except NoWallError:
        return []
    noise = doors.fit.pixel_noise
    found = []
    for view in walls.views(seen, doors):
        if view.s[-1] - view.s[0] > data.min_length:
            cells = np.rint(cells_of(view, noise, doors.view.before * noise) * SCALE)
            target = target_of(view, frame.room, frame.images, settings.target)
            found.append(Sample(cells.astype(np.int8), target))
    return found


def is_validation(index: int, data: DataSettings) -> bool:
    """Tell whether a room never trains; these are spread evenly over the sequence."""
    share = data.validation
    return int((index + 1) * share) > int(index * share)


def _draw(generator: np.random.Generator, weights: Mapping[str, float]) -> str:
    values = np.array(list(weights.values()))
    return str(generator.choice(list(weights), p=values / values.sum()))
