"""Background removal: the points of objects out of a whole scene (paper, Sec. IV-D)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from kmn_perception.scene.concave_edges import find_concave_edges
from kmn_perception.scene.connected_pixels import grow, label_image
from kmn_perception.scene.settings import SceneSettings
from kmn_perception.scene.union_find import join, number

INFINITE = np.full(3, np.inf)
NEIGHBOURS = np.array(
    [(x, y, z) for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1) if (x, y, z) > (0, 0, 0)]
)  # one half of a voxel's 26 neighbours; the other half are their inverses


@dataclass(frozen=True)
class SegmentationSettings:
    """The stages of the background removal, each of which can be switched off.

    Attributes
    ----------
    crop
        Keep only what lies in the crop volume.
    crop_min, crop_max
        Corners of the crop volume in the world frame, metres.
    remove_plane
        Remove the support plane z = 0 and all that lies below it.
    plane_margin
        Height up to which points belong to the support plane, metres.
    cluster
        Divide the points into clusters, of which the large ones are objects; else all points are
        those of one object.
    cluster_step
        Neighbouring points further apart than this belong to different clusters, metres. For
        unorganised points it is the size of the voxels whose neighbourhood joins them.
    cluster_min_points
        Smaller clusters are not objects.
    cluster_concave_angle
        Where a surface folds inwards and deviates by more than this from a flat one, it belongs to
        two clusters, radians; 0: to one. Only organised points tell.
    """

    crop: bool
    crop_min: tuple[float, float, float]
    crop_max: tuple[float, float, float]
    remove_plane: bool
    plane_margin: float
    cluster: bool
    cluster_step: float
    cluster_min_points: int
    cluster_concave_angle: float


class Segments(NamedTuple):
    """The objects' points among all.

    Attributes
    ----------
    points
        (N, 3) all points in the world frame, metres; NaN for none.
    labels
        (N,) of the objects 0, 1, ..., the nearest first; -1 for other points.
    objects
        Number of objects.
    """

    points: NDArray[np.float32]
    labels: NDArray[np.int32]
    objects: int

    def of_object(self, label: int) -> NDArray[np.float32]:
        """Return the points (M, 3) of an object."""
        return _select(self.points, self.labels == label)


def segment(
    points: NDArray[np.float32],
    pose: NDArray[np.float64],
    viewpoint: NDArray[np.float64],
    settings: SegmentationSettings,
    scene: SceneSettings,
) -> Segments:
    """Separate the objects' points from the others.

    Parameters
    ----------
    points
        (height, width, 3) organised or (N, 3) unorganised points, metres; NaN for none.
    pose
        (4, 4) transformation of the points to the world frame.
    viewpoint
        (3,) where the camera stands in the world frame.
    scene
        How organised points are told apart.
    """
    corners = (settings.crop_min, settings.crop_max) if settings.crop else (-INFINITE, INFINITE)
    low, high = np.array(corners)
    if settings.remove_plane:
        low[2] = max(low[2], settings.plane_margin)
    world, kept = _crop(points.reshape(-1, 3), pose, low, high)
    if not settings.cluster or not kept.any():
        return Segments(world, kept.astype(np.int32) - 1, int(kept.any()))
    eye = np.ascontiguousarray(viewpoint)  # compiled once, whatever it is a part of
    if points.ndim == 3:
        image = world.reshape(points.shape)
        labels = _part_image(image, kept, eye, settings, scene)
    else:
        labels = _label_cloud(world, kept, settings.cluster_step)
    return Segments(world, *_sort(world, labels, eye, settings.cluster_min_points))


def _part_image(
    points: NDArray[np.float32],
    kept: NDArray[np.bool_],
    viewpoint: NDArray[np.float64],
    settings: SegmentationSettings,
    scene: SceneSettings,
) -> NDArray[np.int32]:
    """Label organised points by what is connected without a step and without a concave edge."""
    labels = label_image(points, kept, settings.cluster_step, scene.max_gap)
    if settings.cluster_concave_angle == 0.0:
        return labels
    angle, scale = settings.cluster_concave_angle, scene.concave_edges
    concave_edges = find_concave_edges(points, labels, viewpoint, angle, scale.leg, scale.reach)
    if not concave_edges.any():
        return labels
    parts = label_image(points, kept & ~concave_edges, settings.cluster_step, scene.max_gap)
    min_points = settings.cluster_min_points
    return grow(points, parts, kept, settings.cluster_step, min_points, scene.max_gap)


@njit(cache=True)
def _crop(
    points: NDArray[np.float32],
    pose: NDArray[np.float64],
    low: NDArray[np.float64],
    high: NDArray[np.float64],
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Transform points (N, 3) to the world and tell which are finite and within low..high."""
    world = np.empty_like(points)
    kept = np.empty(len(points), dtype=np.bool_)
    for i in range(len(points)):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        inside = np.isfinite(x + y + z)
        for axis in range(3):
            value = pose[axis, 0] * x + pose[axis, 1] * y + pose[axis, 2] * z + pose[axis, 3]
            world[i, axis] = value
            inside = inside and low[axis] <= value <= high[axis]
        kept[i] = inside
    return world, kept


def _label_cloud(
    points: NDArray[np.float32], kept: NDArray[np.bool_], size: float
) -> NDArray[np.int32]:
    """Label the kept points (N,) by the connected voxels of a grid in which they lie."""
    cloud = _select(points, kept)
    voxels = ((cloud - cloud.min(axis=0)) / np.float32(size)).astype(np.int64) + 1
    strides = np.cumprod(np.append(1, voxels.max(axis=0) + 2))[:3]
    keys, inverse = np.unique(voxels @ strides, return_inverse=True)
    labels = np.full(len(points), -1, dtype=np.int32)
    labels[kept] = _label_voxels(keys, NEIGHBOURS @ strides)[inverse]
    return labels


@njit(cache=True)
def _label_voxels(keys: NDArray[np.int64], offsets: NDArray[np.int64]) -> NDArray[np.int32]:
    """Label the connected components of occupied voxels, given by their sorted keys."""
    parents = np.arange(len(keys), dtype=np.int32)
    for offset in offsets:
        for i, j in enumerate(np.searchsorted(keys, keys + offset)):
            if j < len(keys) and keys[j] == keys[i] + offset:
                join(parents, i, j)
    return number(parents, np.ones(len(keys), dtype=np.bool_))


@njit(cache=True)
def _sort(
    points: NDArray[np.float32],
    labels: NDArray[np.int32],
    viewpoint: NDArray[np.float64],
    min_points: int,
) -> tuple[NDArray[np.int32], int]:
    """Return the labels of the large clusters, ordered by mean distance, and their number."""
    counts = np.zeros(labels.max() + 1, dtype=np.int64)
    distances = np.zeros(len(counts))
    for i in range(len(labels)):
        if labels[i] >= 0:
            x = points[i, 0] - viewpoint[0]
            y = points[i, 1] - viewpoint[1]
            z = points[i, 2] - viewpoint[2]
            counts[labels[i]] += 1
            distances[labels[i]] += np.sqrt(x * x + y * y + z * z)
    places, count = np.full(len(counts), -1, dtype=np.int32), 0
    for label in np.argsort(distances / np.maximum(counts, 1)):
        if counts[label] >= min_points:
            places[label] = count
            count += 1
    numbered = np.full_like(labels, -1)
    for i in range(len(labels)):
        if labels[i] >= 0:
            numbered[i] = places[labels[i]]
    return numbered, count


@njit(cache=True)
def _select(points: NDArray[np.float32], kept: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Return ``points[kept]``, which NumPy is slow at for rows of three."""
    selected = np.empty((kept.sum(), 3), dtype=points.dtype)
    count = 0
    for i in range(len(points)):
        if kept[i]:
            for axis in range(3):
                selected[count, axis] = points[i, axis]
            count += 1
    return selected
