"""Statistics of depth images by which a simulated sensor is compared with a real one."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

PATCH = 15  # pixels; side of the squares whose noise is taken
MIN_WIDTH = 10  # pixels; narrower rows of an object are not looked at


def plane_noise(
    depth: NDArray[np.float32], surface: NDArray[np.bool_]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return mean depth (N,) and standard deviation about the plane (N,) of patches, metres.

    Parameters
    ----------
    depth
        (height, width) metres, NaN for none.
    surface
        (height, width) where there is a plane.
    """
    rows, columns = np.mgrid[:PATCH, :PATCH]
    # 1 / z of a plane is linear in the pixel's coordinates.
    design = np.column_stack([rows.ravel(), columns.ravel(), np.ones(PATCH**2)])
    onto = np.eye(PATCH**2) - design @ np.linalg.pinv(design)
    means, deviations = [], []
    for v in range(0, depth.shape[0] - PATCH, PATCH):
        for u in range(0, depth.shape[1] - PATCH, PATCH):
            patch = np.s_[v : v + PATCH, u : u + PATCH]
            if surface[patch].all() and np.isfinite(depth[patch]).all():
                inverse = 1.0 / depth[patch].astype(np.float64).ravel()
                mean = 1.0 / inverse.mean()
                freedom = PATCH**2 - design.shape[1]
                error = onto @ inverse * mean**2
                means.append(mean)
                deviations.append(np.sqrt(error @ error / freedom))
    return np.array(means), np.array(deviations)


def missing_runs(
    depth: NDArray[np.float32],
    object_: NDArray[np.bool_],
    background: NDArray[np.bool_],
    step: int,
) -> NDArray[np.int64]:
    """Return how many pixels are missing beside an object in each row (height,), -1 if unknown.

    Parameters
    ----------
    depth
        (height, width) metres, NaN for none.
    object_, background
        (height, width) pixels of the two; a run that does not end at the background is unknown.
    step
        -1 to the left of the object, 1 to the right.
    """
    runs = np.full(depth.shape[0], -1)
    measured = np.isfinite(depth)
    for v in range(depth.shape[0]):
        columns = np.flatnonzero(object_[v] & measured[v])
        if len(columns) < MIN_WIDTH:
            continue
        beside = np.arange(columns.max() + 1, depth.shape[1])
        if step < 0:
            beside = np.arange(columns.min() - 1, -1, -1)
        found = np.flatnonzero(measured[v, beside])
        if len(found) and background[v, beside[found[0]]]:
            runs[v] = found[0]
    return runs


def inverse_step(depth: NDArray[np.float32], near: float, far: float) -> float:
    """Return the mean step of 1 / z between the levels in which depth comes, 1/m."""
    levels = np.unique(depth[(depth > near) & (depth < far)])
    return float((1.0 / levels[0] - 1.0 / levels[-1]) / (len(levels) - 1))
