"""Statistics of depth images by which a simulated sensor is compared with a real one."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def plane_noise(
    depth: NDArray[np.float32], surface: NDArray[np.bool_], patch: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return mean depth (N,) and standard deviation about the plane (N,) of patches, metres.

    Parameters
    ----------
    depth
        (height, width) metres, NaN for none.
    surface
        (height, width) where there is a plane.
    patch
        Side of the patches, which are squares, in pixels.
    """
    rows, columns = np.mgrid[:patch, :patch]
    # 1 / z of a plane is linear in the pixel's coordinates.
    design = np.column_stack([rows.ravel(), columns.ravel(), np.ones(patch**2)])
    onto = np.eye(patch**2) - design @ np.linalg.pinv(design)
    means, deviations = [], []
    for v in range(0, depth.shape[0] - patch, patch):
        for u in range(0, depth.shape[1] - patch, patch):
            square = np.s_[v : v + patch, u : u + patch]
            if surface[square].all() and np.isfinite(depth[square]).all():
                inverse = 1.0 / depth[square].astype(np.float64).ravel()
                mean = 1.0 / inverse.mean()
                freedom = patch**2 - design.shape[1]
                error = onto @ inverse * mean**2
                means.append(mean)
                deviations.append(np.sqrt(error @ error / freedom))
    return np.array(means), np.array(deviations)


def missing_runs(
    depth: NDArray[np.float32],
    object_: NDArray[np.bool_],
    background: NDArray[np.bool_],
    step: int,
    min_width: int,
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
    min_width
        Rows with fewer measured pixels of the object are unknown.
    """
    runs = np.full(depth.shape[0], -1)
    measured = np.isfinite(depth)
    for v in range(depth.shape[0]):
        columns = np.flatnonzero(object_[v] & measured[v])
        if len(columns) < min_width:
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
