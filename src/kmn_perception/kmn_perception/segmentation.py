"""Background removal: the points of one object out of a whole scene (paper, Sec. IV-D)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

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
        Keep only the nearest large cluster.
    cluster_step
        Neighbouring points further apart than this belong to different clusters, metres. For
        unorganised points it is the size of the voxels whose neighbourhood joins them.
    cluster_min_points
        Smaller clusters are not objects.
    """

    crop: bool
    crop_min: tuple[float, float, float]
    crop_max: tuple[float, float, float]
    remove_plane: bool
    plane_margin: float
    cluster: bool
    cluster_step: float
    cluster_min_points: int


def remove_background(
    points: NDArray[np.float32],
    pose: NDArray[np.float64],
    viewpoint: NDArray[np.float64],
    settings: SegmentationSettings,
) -> NDArray[np.float32]:
    """Return the object's points in the world frame.

    Parameters
    ----------
    points
        (height, width, 3) organised or (N, 3) unorganised points, metres; NaN for none.
    pose
        (4, 4) transformation of the points to the world frame.
    viewpoint
        (3,) where the camera stands in the world frame, from which the nearest cluster counts.

    Returns
    -------
    points
        (M, 3) finite points, world frame, metres; M = 0 if there is no object.
    """
    corners = (settings.crop_min, settings.crop_max) if settings.crop else (-INFINITE, INFINITE)
    low, high = np.array(corners)
    if settings.remove_plane:
        low[2] = max(low[2], settings.plane_margin)
    world, kept = _crop(points.reshape(-1, 3), pose, low, high)
    if settings.cluster and kept.any():
        step = settings.cluster_step
        if points.ndim == 3:
            labels = _label_image(world.reshape(points.shape), kept, step)
        else:
            labels = _label_cloud(world, kept, step)
        eye = np.ascontiguousarray(viewpoint)  # compiled once, whatever it is a part of
        kept = _in_nearest(world, labels, eye, settings.cluster_min_points)
    return _select(world, kept)


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


@njit(cache=True)
def _label_image(
    points: NDArray[np.float32], kept: NDArray[np.bool_], step: float
) -> NDArray[np.int32]:
    """Label the connected components of an organised cloud's kept points (height * width,).

    Pixels beside each other are connected if their points are no further apart than ``step``:
    objects that touch are still told apart where the camera sees a step between them.
    """
    height, width, _ = points.shape
    flat = points.reshape(-1, 3)
    parents = np.arange(height * width, dtype=np.int32)
    for row in range(height):
        for i in range(row * width, (row + 1) * width):
            if kept[i]:
                if i > row * width and kept[i - 1] and _near(flat, i, i - 1, step):
                    _join(parents, i, i - 1)
                if row > 0 and kept[i - width] and _near(flat, i, i - width, step):
                    _join(parents, i, i - width)
    return _number(parents, kept)


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
                _join(parents, i, j)
    return _number(parents, np.ones(len(keys), dtype=np.bool_))


@njit(cache=True)
def _in_nearest(
    points: NDArray[np.float32],
    labels: NDArray[np.int32],
    viewpoint: NDArray[np.float64],
    min_points: int,
) -> NDArray[np.bool_]:
    """Tell which points belong to the large cluster of the smallest mean distance, if any."""
    counts = np.zeros(labels.max() + 1, dtype=np.int64)
    sums = np.zeros(len(counts))
    for i in range(len(labels)):
        if labels[i] >= 0:
            x = points[i, 0] - viewpoint[0]
            y = points[i, 1] - viewpoint[1]
            z = points[i, 2] - viewpoint[2]
            counts[labels[i]] += 1
            sums[labels[i]] += np.sqrt(x * x + y * y + z * z)
    nearest, distance = -2, np.inf
    for label in range(len(counts)):
        if counts[label] >= min_points and sums[label] / counts[label] < distance:
            nearest, distance = label, sums[label] / counts[label]
    return labels == nearest


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


@njit(cache=True)
def _near(points: NDArray[np.float32], i: int, j: int, step: float) -> bool:
    """Tell whether two points are no further apart than ``step``."""
    x = points[i, 0] - points[j, 0]
    y = points[i, 1] - points[j, 1]
    z = points[i, 2] - points[j, 2]
    return x * x + y * y + z * z <= step * step


@njit(cache=True)
def _root(parents: NDArray[np.int32], i: int) -> int:
    """Find the representative of a union-find set, halving the path to it."""
    while parents[i] != i:
        parents[i] = parents[parents[i]]
        i = parents[i]
    return i


@njit(cache=True)
def _join(parents: NDArray[np.int32], i: int, j: int) -> None:
    """Join two union-find sets; the smallest index represents a set."""
    a, b = _root(parents, i), _root(parents, j)
    if a < b:
        parents[b] = a
    else:
        parents[a] = b


@njit(cache=True)
def _number(parents: NDArray[np.int32], kept: NDArray[np.bool_]) -> NDArray[np.int32]:
    """Return labels 0, 1, ... of the union-find sets of the kept elements; -1 for the others."""
    labels = np.full(len(parents), -1, dtype=np.int32)
    count = 0
    for i in range(len(parents)):
        if kept[i]:
            root = _root(parents, i)
            if root == i:
                labels[i] = count
                count += 1
            else:
                labels[i] = labels[root]
    return labels
