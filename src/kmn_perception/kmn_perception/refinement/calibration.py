"""What an error of the camera's calibration makes of the estimated parameters."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from kmn_perception.model.camera import Camera
from kmn_perception.refinement.geometry import Shape, cuboids

CORNERS = np.array([[(i >> axis) % 2 - 0.5 for axis in range(3)] for i in range(8)])


def calibration_covariance(
    shape: Shape, values: NDArray[np.float64], camera: Camera, error: float
) -> NDArray[np.float64]:
    """Return the covariance (P, P) by what a camera measures too large or too small.

    Its depths and both of its focal lengths may each be wrong by some share. All points are
    displaced accordingly, those of the support too, whose plane is z = 0 in the world all the same.
    The parameters follow the corners of the bodies as nearly as they can.

    Parameters
    ----------
    values
        (P,) estimated parameters.
    error
        Standard deviation of each share.
    """
    cubes, jacobians = cuboids(shape, values)
    maps = np.column_stack([CORNERS, np.ones(len(CORNERS))])
    corners: NDArray[np.float64] = np.einsum("bij,kj->bki", cubes, maps).reshape(-1, 3)
    slopes = np.einsum("bijp,kj->bkip", jacobians, maps).reshape(-1, len(values))
    right, down = camera.pose[:3, 0], camera.pose[:3, 1]
    seen, support = corners - camera.position, -float(camera.position[2])
    stretches = np.array([np.eye(3), np.outer(right, right), np.outer(down, down)])
    shifts = [_level(stretch, seen, support).ravel() for stretch in stretches]
    steps = np.linalg.lstsq(slopes, np.column_stack(shifts), rcond=None)[0]
    return np.asarray(error**2 * steps @ steps.T)


def _level(
    stretch: NDArray[np.float64], points: NDArray[np.float64], support: float
) -> NDArray[np.float64]:
    """Return by what points (N, 3) shift, seen from the support at a height, which shifts as well.

    Parameters
    ----------
    stretch
        (3, 3) shift by a unit's error, of the place relative to the camera in the world's axes.
    """
    tilt, rise = stretch[2, :2], stretch[2, 2] * support
    shifts = points @ stretch.T
    raised = points - [0.0, 0.0, support]
    shifts[:, 2] -= points[:, :2] @ tilt + rise
    shifts[:, :2] += raised[:, 2:] * tilt
    return np.asarray(shifts)
