"""Iterative Closest Point, the peer that the paper compares with (paper, Sec. V)."""

from __future__ import annotations

import numpy as np
import open3d
from numpy.typing import NDArray

UNLIMITED = 1e3  # metres; every point has a partner, however far
open3d.utility.set_max_threads(1)  # times are compared on one thread


def align(
    source: NDArray[np.float32], target: NDArray[np.float32], iterations: int
) -> NDArray[np.float64]:
    """Align two clouds by point-to-point ICP that starts from the identity.

    Parameters
    ----------
    source, target
        (N, 3) and (M, 3) points, metres.
    iterations
        Exact number of iterations.

    Returns
    -------
    transform
        (4, 4) rigid transformation of the source onto the target.
    """
    registration = open3d.pipelines.registration
    result = registration.registration_icp(
        _cloud(source),
        _cloud(target),
        UNLIMITED,
        np.eye(4),
        registration.TransformationEstimationPointToPoint(),
        registration.ICPConvergenceCriteria(
            relative_fitness=0.0, relative_rmse=0.0, max_iteration=iterations
        ),
    )
    return np.array(result.transformation)


def _cloud(points: NDArray[np.float32]) -> open3d.geometry.PointCloud:
    return open3d.geometry.PointCloud(open3d.utility.Vector3dVector(points.astype(np.float64)))
