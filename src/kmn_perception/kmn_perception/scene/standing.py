"""What objects stand on: the support plane, or another object, as the camera sees it.

Looking down along an object in the image, what is next to its lowest pixel tells: the support close
by, where it stands on that; another object that it touches, where it may stand on this one; and
something nearer to the camera, which hides where it stands.
"""

from __future__ import annotations

from collections.abc import Sequence
from enum import IntEnum

import cv2
import numpy as np
from numba import njit
from numpy.typing import NDArray

from kmn_perception.scene.free_space import UNKNOWN
from kmn_perception.scene.settings import StandingSettings

SUPPORTED, TOUCHING = 0, 1  # columns of the counts


class Standing(IntEnum):
    """What an object is seen to stand on."""

    SUPPORT = 0
    OBJECT = 1
    UNSEEN = 2


def find_standing(
    points: NDArray[np.float32],
    labels: NDArray[np.int32],
    objects: int,
    down: NDArray[np.float64],
    floor: float,
    settings: StandingSettings,
) -> list[Standing]:
    """Return what each of the objects stands on.

    Parameters
    ----------
    points
        (height, width, 3) world frame, metres, NaN for none.
    labels
        (height, width) number of the object that a pixel shows, negative for none.
    down
        (2,) direction u, v in the image in which things fall; (0, 0) where the camera looks down.
    floor
        World height up to which points belong to the support, metres.
    """
    if np.abs(down[0]) > np.abs(down[1]):
        points, labels, down = points.swapaxes(0, 1), labels.T, down[::-1]
    if down[1] < 0.0:
        points, labels = points[::-1], labels[::-1]
    counts, columns = _count_columns(
        np.ascontiguousarray(points), np.ascontiguousarray(labels), objects, floor, settings
    )
    shares = counts / np.maximum(columns, 1)[:, None]
    return [
        Standing.SUPPORT
        if share[SUPPORTED] >= settings.min_supported
        else (Standing.OBJECT if share[TOUCHING] >= settings.min_touching else Standing.UNSEEN)
        for share in shares
    ]


def forget_beside(
    free: NDArray[np.float32],
    unmeasured: NDArray[np.bool_],
    labels: NDArray[np.int32],
    standing: Sequence[Standing],
    settings: StandingSettings,
) -> None:
    """Let nothing be known of what an object that stands on others may hide of them.

    What it stands on goes on below it. Where exactly the image of one ends and that of the other
    begins is not known, and its shadow, in which nothing is measured, may hide more.

    Parameters
    ----------
    free
        (height, width) see `FreeSpace`; changed in place.
    unmeasured
        (height, width) pixels without a measurement.
    """
    above = np.isin(labels, np.flatnonzero([s is Standing.OBJECT for s in standing]))
    if above.any():
        others = ((labels >= 0) & ~above).astype(np.uint8)
        size = 2 * settings.border + 1
        near = cv2.dilate(others, np.ones((size, size), np.uint8)) > 0
        free[above & near] = UNKNOWN
        _forget_gaps(free, unmeasured, above)


@njit(cache=True)
def _forget_gaps(
    free: NDArray[np.float32], unmeasured: NDArray[np.bool_], above: NDArray[np.bool_]
) -> None:
    """Let nothing be known of the gaps beside some pixels in their rows."""
    height, width = free.shape
    for row in range(height):
        column = 0
        while column < width:
            first = column
            while column < width and unmeasured[row, column]:
                column += 1
            if (first > 0 and above[row, first - 1]) or (column < width and above[row, column]):
                free[row, first:column] = UNKNOWN
            column += 1


@njit(cache=True)
def _count_columns(
    points: NDArray[np.float32],
    labels: NDArray[np.int32],
    objects: int,
    floor: float,
    settings: StandingSettings,
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Count (objects, 2) columns whose lowest pixel is on the support, or touches an object.

    Also return the number (objects,) of all columns of an object.
    """
    height, width, _ = points.shape
    counts = np.zeros((objects, 2), dtype=np.int64)
    columns = np.zeros(objects, dtype=np.int64)
    lowest = np.full(objects, -1)
    for column in range(width):
        lowest[:] = -1
        for row in range(height):
            if labels[row, column] >= 0 and np.isfinite(points[row, column, 2]):
                lowest[labels[row, column]] = row
        for label in range(objects):
            if lowest[label] < 0:
                continue
            columns[label] += 1
            here = points[lowest[label], column]
            for row in range(lowest[label] + 1, min(lowest[label] + settings.gap + 2, height)):
                below = points[row, column]
                if not np.isfinite(below[2]):
                    continue
                distance = np.sqrt(((below - here) ** 2).sum())
                if below[2] > floor:
                    counts[label, TOUCHING] += distance < settings.reach
                elif here[2] < floor + settings.base and distance < settings.reach:
                    counts[label, SUPPORTED] += 1
                break
    return counts, columns
