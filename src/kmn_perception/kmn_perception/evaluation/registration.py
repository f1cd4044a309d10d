"""Rigid registration of point clouds: the peers that need no network (paper, Sec. V)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import open3d
import small_gicp
from numpy.typing import NDArray

from kmn_perception.evaluation.settings import GicpSettings, IcpSettings

Aligner = Callable[[NDArray[np.float32], NDArray[np.float64]], NDArray[np.float64]]
"""Maps a cloud (N, 3) and a first guess (4, 4) to the rigid transform (4, 4) onto the target."""

UNLIMITED = 1e3  # metres; every point has a partner, however far
NORMAL_NEIGHBOURS = 20
open3d.utility.set_max_threads(1)  # times are compared on one thread


def point_to_point(target: NDArray[np.float32], settings: IcpSettings) -> Aligner:
    """Return open3d's point-to-point ICP onto a cloud (M, 3); every point counts."""
    estimation = open3d.pipelines.registration.TransformationEstimationPointToPoint()
    cloud = _cloud(draw(target, settings.target_points))
    return _icp(cloud, estimation, UNLIMITED, settings)


def point_to_plane(target: NDArray[np.float32], settings: IcpSettings) -> Aligner:
    """Return open3d's point-to-plane ICP onto a cloud (M, 3); near points count."""
    estimation = open3d.pipelines.registration.TransformationEstimationPointToPlane()
    cloud = _cloud(draw(target, settings.target_points))
    cloud.estimate_normals(open3d.geometry.KDTreeSearchParamKNN(NORMAL_NEIGHBOURS))
    return _icp(cloud, estimation, settings.plane_distance, settings)


def gicp(target: NDArray[np.float32], settings: GicpSettings) -> Aligner:
    """Return small_gicp's generalised ICP onto a cloud (M, 3)."""

    def prepare(points: NDArray[np.float32]) -> tuple[small_gicp.PointCloud, small_gicp.KdTree]:
        return small_gicp.preprocess_points(
            points.astype(np.float64), downsampling_resolution=settings.voxel, num_threads=1
        )

    prepared, tree = prepare(target)

    def align(source: NDArray[np.float32], start: NDArray[np.float64]) -> NDArray[np.float64]:
        result = small_gicp.align(
            prepared,
            prepare(source)[0],
            tree,
            start,
            max_correspondence_distance=settings.distance,
            max_iterations=settings.iterations,
            num_threads=1,
        )
        return np.array(result.T_target_source)

    return align


def draw(points: NDArray[np.float32], limit: int) -> NDArray[np.float32]:
    """Return up to ``limit`` of the points (N, 3), always the same."""
    count = min(len(points), limit)
    return points[np.random.default_rng(0).choice(len(points), count, replace=False)]


def centre_to_centre(
    source: NDArray[np.float32], target: NDArray[np.float32]
) -> NDArray[np.float64]:
    """Return the translation (4, 4) that moves the mean of one cloud to that of another."""
    transform = np.eye(4)
    transform[:3, 3] = target.mean(axis=0, dtype=np.float64) - source.mean(axis=0, dtype=np.float64)
    return transform


def _icp(
    target: open3d.geometry.PointCloud,
    estimation: open3d.pipelines.registration.TransformationEstimation,
    distance: float,
    settings: IcpSettings,
) -> Aligner:
    registration = open3d.pipelines.registration
    criteria = registration.ICPConvergenceCriteria(
        relative_fitness=settings.tolerance,
        relative_rmse=settings.tolerance,
        max_iteration=settings.iterations,
    )

    def align(source: NDArray[np.float32], start: NDArray[np.float64]) -> NDArray[np.float64]:
        cloud = _cloud(draw(source, settings.points))
        result = registration.registration_icp(cloud, target, distance, start, estimation, criteria)
        return np.array(result.transformation)

    return align


def _cloud(points: NDArray[np.float32]) -> open3d.geometry.PointCloud:
    return open3d.geometry.PointCloud(open3d.utility.Vector3dVector(points.astype(np.float64)))
