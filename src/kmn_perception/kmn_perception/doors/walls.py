"""What every search in a frame begins with: planes, the vertical, the floor, the walls' views."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kmn_perception.doors.inverse_depth import Blocks
from kmn_perception.doors.planes import find_planes
from kmn_perception.doors.settings import DoorSettings
from kmn_perception.doors.upright import find_camera_height, find_up, line_segments
from kmn_perception.doors.wall_view import WallFrame, WallView, view_wall
from kmn_perception.model.camera import Camera

_MAX_WALLS = 3


class NoWallError(ValueError):
    """A frame shows no wall; the text says what is missing."""


class Frame(NamedTuple):
    """What was measured in one exposure.

    Attributes
    ----------
    depth
        (height, width) metres, 0 for none.
    grey
        (height, width) 0 to 1, of the same pixels; None without an image.
    camera
        Their pinhole camera; its pose is not used.
    """

    depth: NDArray[np.float32]
    grey: NDArray[np.float32] | None
    camera: Camera


class Walls(NamedTuple):
    """The walls of a frame.

    Attributes
    ----------
    up
        (3,) the vertical, optical frame.
    height
        Of the camera above the floor, metres; a usual one where the floor is not seen.
    floor_seen
        Whether it is.
    blocks
        The frame's inverse depths.
    views
        Of the largest walls, as far as they are in the image.
    """

    up: NDArray[np.float64]
    height: float
    floor_seen: bool
    blocks: Blocks
    views: list[WallView]


def find_walls(frame: Frame, settings: DoorSettings, generator: np.random.Generator) -> Walls:
    """Find the walls of a frame.

    Raises
    ------
    NoWallError
        If there is no plane, or none that is upright.
    """
    noise = settings.fit.pixel_noise
    blocks = Blocks.of(frame.depth, frame.camera, noise, settings.planes)
    planes = find_planes(blocks, noise, settings.planes, generator)
    if not planes:
        raise NoWallError("no plane is seen")
    segments = None
    if frame.grey is not None:
        segments = line_segments(frame.grey, frame.camera, settings.vertical)
    up = find_up(planes, segments, settings.vertical)
    floor = _camera_height(blocks, up, settings)
    height = settings.prior.handle_height[0] if floor is None else floor
    walls = [p for p in planes if abs(p.normal @ up) < np.sin(settings.vertical.max_wall_tilt)]
    if not walls:
        raise NoWallError("no wall is seen")
    views = []
    for wall in walls[:_MAX_WALLS]:
        at = WallFrame.of(wall.vector, up, height)
        view = view_wall(at, frame.depth, frame.grey, frame.camera, settings.view)
        if view is not None:
            views.append(view)
    return Walls(up, height, floor is not None, blocks, views)


def _camera_height(blocks: Blocks, up: NDArray[np.float64], settings: DoorSettings) -> float | None:
    rays, inverse, valid = blocks.flat()
    return find_camera_height(
        rays[valid] @ up,
        inverse[valid],
        settings.fit.pixel_noise,
        settings.floor.heights,
        settings.floor.min_blocks,
        settings.floor.max_deviation,
    )
