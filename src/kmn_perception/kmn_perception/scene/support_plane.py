"""The plane that supports the objects, a table or the floor, and the camera's pose above it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from kmn_perception.scene.settings import RaisedPlaneSettings

SEED = 0
HYPOTHESES = 256  # finds a plane of 30 % of the points with a probability of 99.9 %
SCORED_POINTS = 1024
FITTED_POINTS = 8192
REFINEMENTS = 3
IMAGE_UP = np.array([0.0, -1.0, 0.0])  # in the optical frame (REP-103: x right, y down, z forward)


@dataclass(frozen=True)
class SupportPlaneSettings:
    """What counts as a support plane.

    Attributes
    ----------
    distance : float
        Largest distance of a point from the plane that it belongs to, in metres.
    max_tilt : float
        Largest angle between the plane's normal and the image's up direction, in radians,
        below pi / 2. It keeps walls and the sides of objects from being taken for the support.
    min_fraction : float
        Minimum share of the measured points that lie on the plane, 0..1; for a higher plane, of
        those that do not lie on the largest one.
    raised : RaisedPlaneSettings
        When a plane above the largest one is the support.
    """

    distance: float
    max_tilt: float
    min_fraction: float
    raised: RaisedPlaneSettings


@dataclass(frozen=True)
class SupportPlane:
    """A plane ``normal . p + height = 0`` in the camera's optical frame.

    Attributes
    ----------
    normal : ndarray of shape (3,)
        Unit normal on the camera's side: the world's up direction.
    height : float
        Height of the camera above the plane, in metres.
    """

    normal: NDArray[np.float64]
    height: float


def find_support_plane(
    points: NDArray[np.float32], settings: SupportPlaneSettings
) -> SupportPlane | None:
    """Find the level plane below the camera on which the objects stand.

    This is the largest one (RANSAC, then least squares), or the highest above it that is large
    enough and on which something stands: at a table's edge more of the floor may be in view than of
    the table. The random numbers have a fixed seed, so that the same points give the
    same plane.

    Parameters
    ----------
    points : ndarray of shape (..., 3)
        Points in the camera's optical frame, in metres, NaN where nothing was measured.
    settings : SupportPlaneSettings

    Returns
    -------
    SupportPlane or None
        None where no plane is large and level enough.
    """
    random = np.random.default_rng(SEED)
    flat = points.reshape(-1, 3)
    measured = np.flatnonzero(np.isfinite(flat[:, 2]))
    if len(measured) < 3:
        return None
    sample = flat[random.choice(measured, FITTED_POINTS)].astype(np.float64)
    largest = _best_hypothesis(sample[:SCORED_POINTS], random, settings)
    support = _fit(sample, largest, settings)
    if support is None:
        return None
    rest = sample[~_on_plane(sample, support, settings)]
    for height in _heights_of_surfaces(rest, support, settings):
        raised = SupportPlane(support.normal, support.height - height)
        plane = _fit(rest, raised, settings)
        if plane is None or plane.normal @ support.normal < np.cos(settings.raised.max_angle):
            continue
        if _something_stands_on(rest, plane, settings):
            return plane
    return support


def pose_above(plane: SupportPlane, canonical_pose: NDArray[np.float64]) -> NDArray[np.float64]:
    """Place the camera over the support plane, which is the world's z = 0.

    The plane shows height, pitch and roll. Ground position and heading, which it cannot show,
    are those of the canonical camera.

    Parameters
    ----------
    plane : SupportPlane
    canonical_pose : ndarray of shape (4, 4)
        Pose of the canonical camera's optical frame in the world.

    Returns
    -------
    ndarray of shape (4, 4)
        Pose of the optical frame in the world.
    """
    seen = _level_axes(plane.normal, np.array([0.0, 0.0, 1.0]))
    wanted = _level_axes(np.array([0.0, 0.0, 1.0]), canonical_pose[:3, 2])
    pose = np.eye(4)
    pose[:3, :3] = wanted @ seen.T
    pose[:3, 3] = canonical_pose[0, 3], canonical_pose[1, 3], plane.height
    return pose


def _level_axes(up: NDArray[np.float64], forward: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the columns level forward, left and up."""
    level = forward - (forward @ up) * up
    level /= np.linalg.norm(level)
    return np.column_stack([level, np.cross(up, level), up])


def _best_hypothesis(
    points: NDArray[np.float64], random: np.random.Generator, settings: SupportPlaneSettings
) -> SupportPlane | None:
    a, b, c = points[random.integers(len(points), size=(3, HYPOTHESES))]
    normals = np.cross(b - a, c - a)
    lengths = np.linalg.norm(normals, axis=1)
    proper = lengths > np.finfo(np.float32).eps
    normals = normals[proper] / lengths[proper, None]
    heights = -np.einsum("ij,ij->i", normals, a[proper])
    side = np.where(heights < 0.0, -1.0, 1.0)
    normals, heights = normals * side[:, None], heights * side
    level = normals @ IMAGE_UP >= np.cos(settings.max_tilt)
    if not level.any():
        return None
    normals, heights = normals[level], heights[level]
    best = np.argmax(_count_inliers(points, normals, heights, settings.distance))
    return SupportPlane(normals[best], float(heights[best]))


def _fit(
    points: NDArray[np.float64], plane: SupportPlane | None, settings: SupportPlaneSettings
) -> SupportPlane | None:
    """Fit a plane to the points (N, 3) near it; None where these are too few."""
    for _ in range(REFINEMENTS):
        if plane is None:
            return None
        inliers = _on_plane(points, plane, settings)
        plane = _least_squares(points[inliers]) if inliers.sum() >= 3 else None
    if plane is None or _on_plane(points, plane, settings).mean() < settings.min_fraction:
        return None
    return plane


def _heights_of_surfaces(
    points: NDArray[np.float64], plane: SupportPlane, settings: SupportPlaneSettings
) -> list[float]:
    """Return the heights (metres above a plane) at which many points lie level, from the top."""
    ends = settings.raised.min_rise, plane.height
    bins = int((ends[1] - ends[0]) / settings.distance)
    if bins < 2:
        return []
    counts, edges = np.histogram(points @ plane.normal + plane.height, bins, ends)
    around = counts[:-1] + counts[1:]
    # Half of them: noise and a plane that is a little oblique spread the points.
    many = around >= max(settings.min_fraction * len(points) / 2.0, 1.0)
    padded = np.pad(around, 1)
    peaks = np.flatnonzero(many & (around >= padded[:-2]) & (around > padded[2:]))
    return [float(edges[peak + 1]) for peak in peaks[::-1]]


def _something_stands_on(
    points: NDArray[np.float64], plane: SupportPlane, settings: SupportPlaneSettings
) -> bool:
    """Tell whether there are points above a surface, no higher than objects are."""
    level = _level_axes(plane.normal, np.array([0.0, 0.0, 1.0]))[:, :2]
    raised = settings.raised
    extent = 100.0 * np.array([raised.margin, 1.0 - raised.margin])
    low, high = np.percentile(points[_on_plane(points, plane, settings)] @ level, extent, axis=0)
    height, place = points @ plane.normal + plane.height, points @ level
    above = (height > 3.0 * settings.distance) & (height < raised.max_object)
    above &= ((place > low) & (place < high)).all(axis=1)
    return bool(above.mean() >= raised.min_standing)


@njit(cache=True)
def _count_inliers(
    points: NDArray[np.float64],
    normals: NDArray[np.float64],
    heights: NDArray[np.float64],
    distance: float,
) -> NDArray[np.int64]:
    """Count the points (N, 3) near each plane (K,): in one thread, which BLAS would not be."""
    counts = np.zeros(len(normals), dtype=np.int64)
    for k in range(len(normals)):
        x, y, z = normals[k, 0], normals[k, 1], normals[k, 2]
        for i in range(len(points)):
            height = x * points[i, 0] + y * points[i, 1] + z * points[i, 2] + heights[k]
            counts[k] += abs(height) <= distance
    return counts


def _on_plane(
    points: NDArray[np.float64], plane: SupportPlane, settings: SupportPlaneSettings
) -> NDArray[np.bool_]:
    return np.abs(points @ plane.normal + plane.height) <= settings.distance


def _least_squares(points: NDArray[np.float64]) -> SupportPlane:
    """Fit a plane by total least squares."""
    centre = points.mean(axis=0)
    offsets = points - centre
    normal = np.linalg.eigh(offsets.T @ offsets)[1][:, 0]
    if normal @ centre > 0.0:
        normal = -normal
    return SupportPlane(normal, float(-normal @ centre))
