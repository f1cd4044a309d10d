"""What every search in a frame begins with: planes, the vertical, the floor, the walls' views."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kmn_perception.doors.camera_check import doubt_height, doubt_tilt, find_contradiction
from kmn_perception.doors.inverse_depth import Blocks
from kmn_perception.doors.planes import Plane, find_planes
from kmn_perception.doors.settings import DoorSettings
from kmn_perception.doors.upright import (
    IMAGE_UP,
    HeightSource,
    SeenHeight,
    find_camera_height,
    find_up,
    line_segments,
)
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
    up, height
        What is known of the camera: the upward unit vector (3,) in the optical frame, and its
        height above the floor, metres. What is not given is found in the frame.
    """

    depth: NDArray[np.float32]
    grey: NDArray[np.float32] | None
    camera: Camera
    up: NDArray[np.float64] | None = None
    height: float | None = None

    @property
    def given(self) -> NDArray[np.float64] | None:
        """(4,) of both, where both are known."""
        if self.up is None or self.height is None:
            return None
        return np.append(self.up, self.height)


class Walls(NamedTuple):
    """The walls of a frame.

    Attributes
    ----------
    up
        (3,) the vertical, optical frame.
    height
        Of the camera above the floor, metres.
    height_source
        How it is known.
    blocks, planes
        The frame's inverse depths, and all planes among them.
    frames
        Of the largest walls.
    given
        What was known of the camera before, see `Frame.given`.
    """

    up: NDArray[np.float64]
    height: float
    height_source: HeightSource
    blocks: Blocks
    planes: list[Plane]
    frames: list[WallFrame]
    given: NDArray[np.float64] | None

    def views(self, frame: Frame, settings: DoorSettings) -> Iterator[WallView]:
        """Yield the views of the walls that are in the image, the largest first."""
        for wall in self.frames:
            view = view_wall(wall, frame.depth, frame.grey, frame.camera, settings.view)
            if view is not None:
                yield view

    def are_given_as(self, frame: Frame) -> bool:
        """Return whether the same is given of another frame's camera."""
        if self.given is None or frame.given is None:
            return self.given is frame.given
        return np.allclose(self.given, frame.given)

    def at_height(self, height: float) -> Walls:
        """Return the walls as seen from another height above a floor that is not in view."""
        frames = [replace(wall, height=height) for wall in self.frames]
        return self._replace(height=height, frames=frames)


def find_walls(frame: Frame, settings: DoorSettings, generator: np.random.Generator) -> Walls:
    """Find the walls of a frame.

    Raises
    ------
    NoWallError
        If there is no plane, or none that is upright, or if the planes contradict what is given.
    """
    noise = settings.fit.pixel_noise
    blocks = Blocks.of(frame.depth, frame.camera, noise, settings.planes)
    planes = find_planes(blocks, noise, settings.planes, generator)
    if not planes:
        raise NoWallError("no plane is seen")
    up = _up(frame, planes, settings)
    if frame.up is not None:
        wrong = find_contradiction(planes, frame.up, frame.height, settings)
        if not wrong and frame.grey is not None:
            wrong = doubt_tilt(frame.up, _seen_up(frame, planes, frame.up, settings), settings)
        if wrong:
            raise NoWallError(wrong)
    walls = [p for p in planes if abs(p.normal @ up) < np.sin(settings.vertical.max_wall_tilt)]
    if not walls:
        raise NoWallError("no wall is seen")
    height, source = frame.height, HeightSource.GIVEN
    seen = _camera_height(blocks, up, walls, settings)
    if height is not None and seen is not None:
        wrong = doubt_height(height, seen, settings)
        if wrong:
            raise NoWallError(wrong)
    elif height is None and seen is not None:
        height, source = seen.metres, HeightSource.SEEN
    elif height is None:
        height, source = settings.prior.handle_height[0], HeightSource.USUAL
    frames = [WallFrame.of(wall.vector, up, height) for wall in walls[:_MAX_WALLS]]
    return Walls(up, height, source, blocks, planes, frames, frame.given)


def _up(frame: Frame, planes: Sequence[Plane], settings: DoorSettings) -> NDArray[np.float64]:
    """Return the upward vector (3,) as the frame shows it, near the one that is given."""
    if frame.up is None:
        return _seen_up(frame, planes, IMAGE_UP, settings)
    if frame.grey is None:
        return frame.up
    segments = line_segments(frame.grey, frame.camera, settings.vertical)
    return find_up(planes, segments, settings.vertical, frame.up, is_given=True)


def _seen_up(
    frame: Frame, planes: Sequence[Plane], expected: NDArray[np.float64], settings: DoorSettings
) -> NDArray[np.float64]:
    """Return the upward vector (3,) that a frame shows near the one that is expected."""
    segments = None
    if frame.grey is not None:
        segments = line_segments(frame.grey, frame.camera, settings.vertical)
    return find_up(planes, segments, settings.vertical, expected)


def _camera_height(
    blocks: Blocks, up: NDArray[np.float64], walls: Sequence[Plane], settings: DoorSettings
) -> SeenHeight | None:
    """Return the camera's height above the floor, from what lies on no wall."""
    rays, inverse, valid = blocks.flat()
    level = np.ones_like(valid)
    for wall in walls:
        reach = settings.planes.inlier * settings.fit.pixel_noise
        level &= np.abs(rays @ wall.vector - inverse) > reach
    return find_camera_height(
        rays[valid] @ up,
        inverse[valid],
        level[valid],
        settings.fit.pixel_noise,
        settings.floor.heights,
        settings.floor.min_blocks,
        settings.floor.max_deviation,
    )
