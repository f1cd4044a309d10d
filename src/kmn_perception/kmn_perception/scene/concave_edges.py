"""Concave edges: where objects touch, the surface that a camera sees folds inwards.

A convex object has none (Stein et al., Object Partitioning Using Local Convexity, CVPR 2014).
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

DIRECTIONS = np.array([(0, 1), (1, 0), (1, 1), (1, -1)])  # rows and columns, half of all


@njit(cache=True)
def find_concave_edges(
    points: NDArray[np.float32],
    labels: NDArray[np.int32],
    viewpoint: NDArray[np.float64],
    angle: float,
    leg: int,
    reach: int,
) -> NDArray[np.bool_]:
    """Tell at which pixels a connected surface folds inwards by more than an angle.

    Parameters
    ----------
    points
        (height, width, 3) metres, in the frame of the viewpoint.
    labels
        (height * width,) connected component of each pixel, -1 for none. A mean point takes none
        but pixels of its own component.
    viewpoint
        (3,) where the camera stands.
    angle
        By which the surface deviates from flat, radians.
    leg, reach
        See `ConcaveEdgeSettings`.

    Returns
    -------
    concave_edges
        (height * width,)
    """
    height, width, _ = points.shape
    means = _mean_points(points, labels, reach)
    concave_edges = np.zeros(height * width, dtype=np.bool_)
    steepest = np.tan(0.5 * angle) ** 2
    for row in range(leg, height - leg):
        for column in range(leg, width - leg):
            i = row * width + column
            if labels[i] < 0:
                continue
            for d in range(4):
                offset = leg * (DIRECTIONS[d, 0] * width + DIRECTIONS[d, 1])
                if labels[i - offset] == labels[i] == labels[i + offset] and _folds_inwards(
                    means[i - offset], means[i], means[i + offset], viewpoint, steepest
                ):
                    concave_edges[i] = True
                    break
    return concave_edges


@njit(cache=True)
def _folds_inwards(
    before: NDArray[np.float32],
    here: NDArray[np.float32],
    after: NDArray[np.float32],
    viewpoint: NDArray[np.float64],
    steepest: float,
) -> bool:
    """Tell whether a point lies far behind the chord of its neighbours, for its length."""
    sag, half_chord, away = 0.0, 0.0, 0.0
    for axis in range(3):
        offset = here[axis] - 0.5 * (before[axis] + after[axis])
        sag += offset**2
        half_chord += 0.25 * (after[axis] - before[axis]) ** 2
        away += offset * (here[axis] - viewpoint[axis])
    return away > 0.0 and sag > steepest * half_chord


@njit(cache=True)
def _mean_points(
    points: NDArray[np.float32], labels: NDArray[np.int32], reach: int
) -> NDArray[np.float32]:
    """Return the mean point (height * width, 3) around each labelled pixel, of its component."""
    height, width, _ = points.shape
    flat = points.reshape(-1, 3)
    means = np.empty_like(flat)
    for row in range(height):
        for column in range(width):
            i = row * width + column
            if labels[i] < 0:
                continue
            x, y, z, count = 0.0, 0.0, 0.0, 0
            for v in range(max(row - reach, 0), min(row + reach + 1, height)):
                for u in range(max(column - reach, 0), min(column + reach + 1, width)):
                    j = v * width + u
                    if labels[j] == labels[i]:
                        x, y, z = x + flat[j, 0], y + flat[j, 1], z + flat[j, 2]
                        count += 1
            means[i, 0], means[i, 1], means[i, 2] = x / count, y / count, z / count
    return means
