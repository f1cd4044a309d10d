"""How far each pixel of a sensor saw: what is seen to be empty, and what is not known."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from kmn_perception.model.camera import Camera
from kmn_perception.model.observation import FreeSpace
from kmn_perception.model.point_rendering import splat

UNKNOWN, EMPTY = 0.0, np.inf  # metres


def free_space(
    points: NDArray[np.float32],
    labels: NDArray[np.int32],
    to_camera: NDArray[np.float64],
    to_world: NDArray[np.float64],
    floor: float,
    border_run: int,
    shadow: tuple[float, float],
) -> FreeSpace:
    """Return up to which depth each pixel sees nothing.

    It is the depth of what is measured; infinite for the support, since no object is below it.
    Where nothing was measured, it is the larger one of those beside the gap in the same row: a
    sensor with a projector beside it does not measure in the shadow that something near throws on
    something far, so that the gap may hide the far thing, but not the near one. Of a gap within an
    object nothing is known, nor of one that is wider than such a shadow: something was there that
    could not be measured. A wide gap up to the image's border, along its row and its column,
    shows nothing in range; of a narrow one nothing is known.

    Parameters
    ----------
    points
        (height, width, 3) metres, NaN for none.
    labels
        (height, width) number of the object that a pixel shows, negative for none.
    to_camera, to_world
        (4, 4) transformations of the points to the optical frame and to the world frame.
    floor
        World height in metres of what belongs to the support.
    border_run
        Pixels at the image's border that a sensor may not measure at all.
    shadow
        Width of a shadow in pixels by the difference of inverse depths (1/m) that throws it, which
        is the focal length times the sensor's baseline, and pixels by which it may be wider.
    """
    rows = to_camera[2].copy(), to_world[2].copy()
    free = _free_depth(points, labels, *rows, floor, border_run, shadow)
    return FreeSpace(free, np.isnan(points[..., 2]))


def free_space_of_cloud(points: NDArray[np.float32], camera: Camera, floor: float) -> FreeSpace:
    """Return up to which depth each pixel of a camera sees nothing of unorganised points.

    Pixels without a point above the support are taken for empty.

    Parameters
    ----------
    points
        (N, 3) world frame, metres, NaN for none.
    floor
        World height in metres of what belongs to the support.
    """
    above = points[points[:, 2] > floor]
    free = splat(camera, above, np.eye(4), 0)
    return FreeSpace(free, np.zeros(free.shape, dtype=np.bool_))


@njit(cache=True)
def _free_depth(
    points: NDArray[np.float32],
    labels: NDArray[np.int32],
    to_depth: NDArray[np.float64],
    to_height: NDArray[np.float64],
    floor: float,
    border_run: int,
    shadow: tuple[float, float],
) -> NDArray[np.float32]:
    height, width, _ = points.shape
    free = np.empty((height, width), dtype=np.float32)
    for row in range(height):
        last, left, left_label = -1, UNKNOWN, -1
        for column in range(width):
            depth = _along(to_depth, points[row, column])
            if not np.isfinite(depth):
                continue
            label = labels[row, column]
            hidden = label >= 0 and label == left_label
            if left != UNKNOWN:
                widest = shadow[0] * abs(1.0 / left - 1.0 / depth) + shadow[1]
                hidden = hidden or column - last - 1 > widest
            _fill(free[row], last + 1, column, left, depth, hidden, border_run)
            on_support = _along(to_height, points[row, column]) <= floor
            free[row, column] = EMPTY if on_support else depth
            last, left, left_label = column, depth, label
        _fill(free[row], last + 1, width, left, UNKNOWN, False, border_run)
    _forget_narrow_gaps(free, points, border_run)
    return free


@njit(cache=True)
def _forget_narrow_gaps(
    free: NDArray[np.float32], points: NDArray[np.float32], border_run: int
) -> None:
    """Let nothing be known of narrow gaps at the upper and the lower border."""
    height, width = free.shape
    for column in range(width):
        for first, step in ((0, 1), (height - 1, -1)):
            length = 0
            while length <= border_run and length < height:
                if np.isfinite(points[first + step * length, column, 2]):
                    break
                length += 1
            if length <= border_run and length < height:
                for k in range(length):
                    free[first + step * k, column] = UNKNOWN


@njit(cache=True)
def _along(row: NDArray[np.float64], point: NDArray[np.float32]) -> float:
    """Return one coordinate of a transformed point."""
    return float(row[0] * point[0] + row[1] * point[1] + row[2] * point[2] + row[3])


@njit(cache=True)
def _fill(
    free: NDArray[np.float32],
    start: int,
    stop: int,
    left: float,
    right: float,
    hidden: bool,
    border_run: int,
) -> None:
    """Fill a gap between two depths, one of which is unknown at the image's border."""
    if hidden:
        free[start:stop] = UNKNOWN
    elif left != UNKNOWN and right != UNKNOWN:
        free[start:stop] = max(left, right)
    else:
        free[start:stop] = EMPTY if stop - start > border_run else UNKNOWN


@njit(cache=True)
def is_truncated(mask: NDArray[np.bool_], free: NDArray[np.float32]) -> bool:
    """Tell whether an object's pixels reach the image's border, or the unknown pixels there."""
    return _reaches_the_sides(mask, free) or _reaches_the_sides(mask.T, free.T)


@njit(cache=True)
def _reaches_the_sides(mask: NDArray[np.bool_], free: NDArray[np.float32]) -> bool:
    height, width = mask.shape
    for row in range(height):
        first, last = 0, width - 1
        while first < last and free[row, first] == UNKNOWN:
            first += 1
        while last > first and free[row, last] == UNKNOWN:
            last -= 1
        if mask[row, first] or mask[row, last]:
            return True
    return False
