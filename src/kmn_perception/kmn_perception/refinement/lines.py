"""Straight edges of bodies in an image: their ends, their derivatives, and what they touch."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from kmn_perception.model.parts import NO_AXIS

MIN_DEPTH = 1e-3  # metres in front of the camera; edges are clipped there


@njit(cache=True, error_model="numpy")
def line_jacobian(
    result: NDArray[np.float64],
    line: NDArray[np.floating],
    length: float,
    edge: tuple[NDArray[np.float64], NDArray[np.float64]],
    jacobians: tuple[NDArray[np.float64], NDArray[np.float64]],
) -> None:
    """Fill in the derivatives (3, P) of a line, the cross product of two vectors by its length."""
    start, direction = edge
    start_jacobian, direction_jacobian = jacobians
    for i in range(result.shape[1]):
        derivative = np.cross(start_jacobian[:, i], direction) + np.cross(
            start, direction_jacobian[:, i]
        )
        derivative /= length
        stretch = line[0] * derivative[0] + line[1] * derivative[1]
        result[:, i] = derivative - stretch * line


@njit(cache=True, error_model="numpy")
def touches(
    cubes: NDArray[np.float64],
    cylinders: NDArray[np.int64],
    body: int,
    edge: int,
    contact: float,
) -> bool:
    """Return whether the middle of an edge is in, or within ``contact`` metres of, another body."""
    axis = edge // 4
    middle = cubes[body, :, 3].copy()
    middle += ((edge // 2) % 2 - 0.5) * cubes[body, :, (axis + 1) % 3]
    middle += (edge % 2 - 0.5) * cubes[body, :, (axis + 2) % 3]
    for other in range(cubes.shape[0]):
        if other == body:
            continue
        outside, across, radius = -np.inf, 0.0, 0.0
        for k in range(3):
            side = cubes[other, :, k]
            length = np.sqrt((side * side).sum())
            along = abs((side * (middle - cubes[other, :, 3])).sum()) / length
            if cylinders[other] == NO_AXIS or cylinders[other] == k:
                outside = max(outside, along - 0.5 * length)
            else:
                across, radius = np.hypot(across, along), 0.5 * length
        if cylinders[other] != NO_AXIS:
            outside = max(outside, across - radius)
        if outside <= contact:
            return True
    return False


@njit(cache=True, error_model="numpy")
def ends_in_view(
    ends: NDArray[np.float64], start: NDArray[np.float64], direction: NDArray[np.float64]
) -> bool:
    """Fill in the ends in the image of the part of an edge that is in front of the camera.

    Return whether there is such a part.
    """
    low, high = -0.5, 0.5
    if direction[2] != 0.0:
        crossing = (MIN_DEPTH - start[2]) / direction[2]
        if direction[2] > 0.0:
            low = max(low, crossing)
        else:
            high = min(high, crossing)
    elif start[2] < MIN_DEPTH:
        return False
    if low >= high:
        return False
    for k in range(2):
        point = start + (low if k == 0 else high) * direction
        ends[2 * k] = point[0] / point[2]
        ends[2 * k + 1] = point[1] / point[2]
    return True
