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
    """Return the unit quaternion (4,) of a rotation matrix (3, 3) (Bar-Itzhack, 2000)."""
    r = rotation
    symmetric = np.zeros((4, 4))
    symmetric[:3, :3] = r + r.T - np.trace(r) * np.eye(3)
    symmetric[:3, 3] = r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]
    symmetric[3, 3] = np.trace(r)
    return np.linalg.eigh(symmetric, UPLO="U")[1][:, -1]
