"""Which way is up, from the floor, the walls, and the vertical lines of the image.

The floor's normal alone is 1 to 3 degrees wrong under a stereo camera; walls agree with the
vertical vanishing point to a degree, and line segments tell it to a few tenths.
"""

from __future__ import annotations

from collections.abc import Sequence
from enum import Enum, auto
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from kmn_perception.doors.planes import Plane
from kmn_perception.doors.search_settings import VerticalSettings
from kmn_perception.model.camera import Camera

_REWEIGHTINGS = 12
_DEVIATIONS = 5.0  # of what is known before, within which segments may be vertical
_UNDER, _FEW = 0.1, 0.4  # lower by this part of the height; how much of it reflections are
IMAGE_UP = np.array([0.0, -1.0, 0.0])


class SeenHeight(NamedTuple):
    """The camera's height above the floor in view.

    Attributes
    ----------
    metres
        The height.
    gain
        By how much it is wrong for an error of the floor's inverse depths, m^2.
    """

    metres: float
    gain: float


class HeightSource(Enum):
    """How the camera's height above the floor is known: as given, as seen, or as it usually is."""

    GIVEN = auto()
    SEEN = auto()
    USUAL = auto()


def line_segments(
    grey: NDArray[np.float32], camera: Camera, settings: VerticalSettings
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the image's line segments as planes through the camera.

    Returns
    -------
    normals
        (N, 3) unit normals of these planes, optical frame.
    deviations
        (N,) their standard deviations about the segment's middle, radians.
    """
    image = (np.clip(np.nan_to_num(grey), 0.0, 1.0) * 255.0).astype(np.uint8)
    found = cv2.createLineSegmentDetector(cv2.LSD_REFINE_STD).detect(image)[0]
    ends: NDArray[np.float64] = np.asarray(
        [] if found is None else found, dtype=np.float64
    ).reshape(-1, 4)
    length = np.hypot(ends[:, 2] - ends[:, 0], ends[:, 3] - ends[:, 1])
    ends, length = ends[length >= settings.min_segment], length[length >= settings.min_segment]
    normals = np.cross(camera.rays(ends[:, 0], ends[:, 1]), camera.rays(ends[:, 2], ends[:, 3]))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    # A line is fitted to as many pixels as it is long: its direction is known by length^-1.5.
    deviations = settings.segment_noise / length * np.sqrt(settings.min_segment / length)
    return np.asarray(normals, dtype=np.float64), deviations


def find_up(
    planes: Sequence[Plane],
    segments: tuple[NDArray[np.float64], NDArray[np.float64]] | None,
    settings: VerticalSettings,
    expected: NDArray[np.float64] = IMAGE_UP,
    is_given: bool = False,
) -> NDArray[np.float64]:
    """Return the unit vector (3,) that points up, in the optical frame.

    It is the direction least against all that is known: perpendicular to walls and to the planes of
    vertical segments, near the floor's normal or, without a floor, near the one that is expected.
    One that ``is_given``, by the camera's pose, is better than what a floor tells.
    """
    floor = max(
        (p for p in planes if p.normal @ expected > np.cos(settings.max_floor_tilt)),
        key=lambda plane: plane.blocks,
        default=None,
    )
    guess = expected if is_given or floor is None else floor.normal
    trust = settings.image_deviation if floor is None else settings.floor_deviation
    if is_given:
        trust = settings.given_deviation
    known = (np.eye(3) - np.outer(guess, guess)) / trust**2
    for plane in planes:
        if abs(plane.normal @ guess) < np.sin(settings.max_wall_tilt):
            known += np.outer(plane.normal, plane.normal) / settings.wall_deviation**2
    up = _least(known, guess)
    if segments is None:
        return up
    normals, deviations = segments
    window = min(settings.search, _DEVIATIONS * trust)
    for _ in range(_REWEIGHTINGS):
        off = normals @ up
        scale = 3.0 * deviations + window / 6.0
        weights = np.where(np.abs(off) < np.sin(window), deviations**-2.0, 0.0)
        weights /= (1.0 + (off / scale) ** 2) ** 2
        up = _least(known + (normals.T * weights) @ normals, guess)
        window = max(0.7 * window, settings.accept)
    return up


def _least(information: NDArray[np.float64], guess: NDArray[np.float64]) -> NDArray[np.float64]:
    up = np.linalg.eigh(information)[1][:, 0]
    return up * np.sign(up @ guess)


def find_camera_height(
    blocks_up: NDArray[np.float64],
    inverse: NDArray[np.float64],
    level: NDArray[np.bool_],
    noise: float,
    heights: tuple[float, float],
    min_blocks: int,
    max_deviation: float,
) -> SeenHeight | None:
    """Return the camera's height above the floor, or None where no floor is in view.

    The floor is the surface on which blocks below the camera agree about its height, and below
    which nothing is: a table is not the floor.

    Parameters
    ----------
    blocks_up
        (N,) rays times the upward vector.
    inverse
        (N,) inverse depths of the same blocks, 1/m.
    level
        (N,) which of them may be a floor: those on no wall.
    max_deviation
        Of the height that a single block tells, as a fraction of it.
    """
    below = blocks_up < 0.0
    drop = -blocks_up[below]
    over = inverse[below] / drop  # 1 / height of a camera above a floor there
    deviation = noise / drop
    low, high = 1.0 / heights[1], 1.0 / heights[0]
    told = deviation < max_deviation * over
    everything = over[told], deviation[told]
    told &= level[below]
    over, deviation, drop = over[told], deviation[told], drop[told]
    if not len(over):
        return None
    grid = np.linspace(low, high, 400)
    width = deviation + 0.02 * over
    density = np.exp(-0.5 * ((grid[:, None] - over) / width) ** 2).sum(axis=1)
    peaks = [
        i
        for i in range(1, len(grid) - 1)
        if density[i - 1] <= density[i] > density[i + 1] and density[i] >= min_blocks
    ]
    for peak in sorted(peaks, key=lambda i: -density[i]):
        value = float(grid[peak])
        for _ in range(6):
            near = np.abs(over - value) < 3.0 * (deviation + 0.005 * value)
            if near.sum() >= 3:
                value = float(np.average(over[near], weights=deviation[near] ** -2.0))
        under = everything[0] < (1.0 - _UNDER) * value - 3.0 * everything[1]
        if under.sum() < _FEW * near.sum():
            return SeenHeight(1.0 / value, 1.0 / (value**2 * float(np.median(drop[near]))))
    return None
