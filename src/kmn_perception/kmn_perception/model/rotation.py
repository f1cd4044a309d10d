"""Rotation matrices and unit quaternions (x, y, z, w), as ROS orders them."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray


def matrix_from_quaternion(quaternion: ArrayLike) -> NDArray[np.float64]:
    """Return the rotation matrix (3, 3) of a quaternion (4,) of any length above 0."""
    x, y, z, w = np.asarray(quaternion, dtype=np.float64) / np.linalg.norm(quaternion)
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + 2.0 * w * cross + 2.0 * cross @ cross


def quaternion_from_matrix(rotation: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the unit quaternion (..., 4) of rotation matrices (..., 3, 3) (Bar-Itzhack, 2000)."""
    r, turned = rotation, np.swapaxes(rotation, -1, -2)
    trace = np.trace(r, axis1=-2, axis2=-1)[..., None, None]
    symmetric = np.zeros((*r.shape[:-2], 4, 4))
    symmetric[..., :3, :3] = r + turned - trace * np.eye(3)
    symmetric[..., :3, 3] = (turned - r)[..., (1, 2, 0), (2, 0, 1)]
    symmetric[..., 3, 3] = trace[..., 0, 0]
    return np.linalg.eigh(symmetric, UPLO="U")[1][..., :, -1]


def rotation_about(axis: ArrayLike, angle: float) -> NDArray[np.float64]:
    """Return the rotation matrix (3, 3) about an axis (3,) of any length above 0, by radians."""
    direction = np.asarray(axis, dtype=np.float64) / np.linalg.norm(axis)
    return matrix_from_quaternion([*(np.sin(angle / 2.0) * direction), np.cos(angle / 2.0)])
