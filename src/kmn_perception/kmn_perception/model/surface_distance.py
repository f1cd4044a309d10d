"""How far observed points lie from the surface of a model."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from kmn_perception.model.parts import NO_AXIS


def surface_distances(
    unit_cubes: NDArray[np.float64],
    points: NDArray[np.float32],
    axes: NDArray[np.int64] | None = None,
) -> NDArray[np.float32]:
    """Return the distance (N,) of points (N, 3) to the nearest body's surface, metres.

    Parameters
    ----------
    unit_cubes
        (B, 4, 4) maps of the unit cube to the world whose axes are orthogonal.
    axes
        (B,) as ``KinematicModel.cylinder_axes``; without them, all bodies are cuboids.
    """
    axes = np.full(len(unit_cubes), NO_AXIS) if axes is None else axes
    size = np.linalg.norm(unit_cubes[:, :3, :3], axis=1)
    rotation = unit_cubes[:, :3, :3] / size[:, None, :]
    return _distances(rotation, unit_cubes[:, :3, 3].copy(), size / 2.0, axes, points)


@njit(cache=True)
def _distances(
    rotation: NDArray[np.float64],
    centre: NDArray[np.float64],
    half: NDArray[np.float64],
    cylinders: NDArray[np.int64],
    points: NDArray[np.float32],
) -> NDArray[np.float32]:
    distances = np.full(points.shape[0], np.inf, dtype=np.float32)
    for i in range(points.shape[0]):
        for b in range(centre.shape[0]):
            outside, inside = 0.0, -np.inf
            across, radius = 0.0, 0.0
            for axis in range(3):
                along = 0.0
                for k in range(3):
                    along += rotation[b, k, axis] * (points[i, k] - centre[b, k])
                if cylinders[b] != NO_AXIS and axis != cylinders[b]:
                    across, radius = np.hypot(across, along), half[b, axis]
                    continue
                beyond = abs(along) - half[b, axis]
                inside = max(inside, beyond)
                outside += max(beyond, 0.0) ** 2
            if cylinders[b] != NO_AXIS:
                inside = max(inside, across - radius)
                outside += max(across - radius, 0.0) ** 2
            distance = np.sqrt(outside) if outside > 0.0 else -inside
            distances[i] = min(distances[i], distance)
    return distances
