"""Planes of an upright box fitted to the faces that a camera sees of it, at right angles."""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from kmn_perception.experiments.settings import FaceSettings
from kmn_perception.model.depth_sensor import DepthSensor

SIDES = ("-x", "+x", "-y", "+y", "top")
TOP = 4
NOWHERE = -1  # of pixels that belong to no face


class Faces(NamedTuple):
    """Fitted faces.

    Attributes
    ----------
    origin
        (2,) about which the planes are given, metres.
    yaw, yaw_deviation
        Radians, from the world's x axis to that of the box, in [-pi/4, pi/4].
    offsets, deviations
        (5,) coordinate of each face's plane along its axis of the box, and its standard
        deviation, metres; NaN for faces that are not seen.
    """

    origin: NDArray[np.float64]
    yaw: float
    yaw_deviation: float
    offsets: NDArray[np.float64]
    deviations: NDArray[np.float64]

    @property
    def axes(self) -> NDArray[np.float64]:
        """(3, 3) axes of the box in the world, as rows."""
        return box_axes(self.yaw)


def box_axes(yaw: float) -> NDArray[np.float64]:
    """Return the axes (3, 3) of a box, as rows."""
    cos, sin = np.cos(yaw), np.sin(yaw)
    return np.array([[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]])


def axial_noise(depth: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the standard deviation of a Kinect's depth (Nguyen, Izadi and Lovell, 2012)."""
    return DepthSensor.load("kinect_v1").nguyen.deviation(depth)


def smoothed_normals(
    points: NDArray[np.float64], mask: NDArray[np.bool_], settings: FaceSettings
) -> NDArray[np.float64]:
    """Return unit normals (height, width, 3) of the masked points; NaN too near to their rim."""
    window, reach = settings.normal_window, settings.normal_reach
    weight = mask.astype(np.float64)
    count = cv2.boxFilter(weight, -1, (window, window), normalize=False)
    total = cv2.boxFilter(
        np.where(mask[..., None], points, 0.0), -1, (window, window), normalize=False
    )
    mean = total / np.maximum(count, 1.0)[..., None]
    mean[~mask | (count < settings.normal_share * window**2)] = np.nan
    across, down = np.full_like(mean, np.nan), np.full_like(mean, np.nan)
    across[:, reach:-reach] = mean[:, 2 * reach :] - mean[:, : -2 * reach]
    down[reach:-reach] = mean[2 * reach :] - mean[: -2 * reach]
    normals = np.cross(down, across)
    unit: NDArray[np.float64] = normals / np.linalg.norm(normals, axis=-1, keepdims=True)
    return unit


def fit_faces(
    points: NDArray[np.float64],
    depth: NDArray[np.float64],
    mask: NDArray[np.bool_],
    settings: FaceSettings,
) -> Faces | None:
    """Fit the faces of the box that the masked points show.

    Parameters
    ----------
    points
        (height, width, 3) in a world whose z axis points up from the support, metres.
    depth
        (height, width) metres along the optical axis.

    Returns
    -------
    faces
        None where no upright face is seen.
    """
    normals = smoothed_normals(points, mask, settings)
    known = mask & np.isfinite(normals[..., 0])
    rows, columns = np.nonzero(known)
    p, n, z = points[known], normals[known], depth[known]
    level = np.abs(n[:, 2]) < settings.level
    if level.sum() < settings.min_pixels:
        return None
    angle = np.arctan2(n[level, 1], n[level, 0])
    yaw = float(np.angle(np.exp(4j * angle).mean()) / 4.0)
    origin = p[:, :2].mean(axis=0)
    p = np.column_stack([p[:, :2] - origin, p[:, 2]])
    sigma = axial_noise(z)
    blocks = (rows // settings.block) * 10_000 + columns // settings.block
    faces = Faces(origin, yaw, np.nan, np.full(5, np.nan), np.full(5, np.nan))
    for _ in range(settings.steps):
        belongs = _assign(p, n, sigma, faces, settings)
        belongs = _away_from_corners(p, belongs, faces, settings)
        if not ((belongs != NOWHERE) & (belongs != TOP)).any():
            return None
        faces = _step(p, sigma, blocks, belongs, faces, settings)
    return faces


def _assign(
    p: NDArray[np.float64],
    n: NDArray[np.float64],
    sigma: NDArray[np.float64],
    faces: Faces,
    settings: FaceSettings,
) -> NDArray[np.int64]:
    """Return the face (N,) that each point lies on, by its normal and its distance."""
    axes = faces.axes
    belongs = np.full(len(p), NOWHERE)
    for side in range(5):
        axis, sign = axes[side // 2], 1.0 if side % 2 or side == TOP else -1.0
        on = sign * (n @ axis) > settings.cosine
        if on.sum() < settings.min_pixels:
            continue
        if not np.isnan(faces.offsets[side]):
            distance = np.abs(p @ axis - faces.offsets[side])
            on &= distance < np.maximum(settings.outlier * sigma, settings.nearest)
        if on.sum() >= settings.min_pixels:
            belongs[on] = side
    return belongs


def _away_from_corners(
    p: NDArray[np.float64], belongs: NDArray[np.int64], faces: Faces, settings: FaceSettings
) -> NDArray[np.int64]:
    """Take points near other faces from their face: a sensor's windows round the corners off."""
    kept = belongs.copy()
    for side in np.flatnonzero(np.isfinite(faces.offsets)):
        near = np.abs(p @ faces.axes[side // 2] - faces.offsets[side]) < settings.corner
        for other in np.unique(belongs):
            away = (belongs == other) & ~near
            if other // 2 != side // 2 and away.sum() >= settings.min_pixels:
                kept[(belongs == other) & near] = NOWHERE
    return kept


def _step(
    p: NDArray[np.float64],
    sigma: NDArray[np.float64],
    blocks: NDArray[np.int64],
    belongs: NDArray[np.int64],
    faces: Faces,
    settings: FaceSettings,
) -> Faces:
    """Fit yaw and offsets to the assigned points: one Gauss-Newton step from the present yaw.

    The noise of neighbouring pixels is not independent. The covariance is therefore taken from the
    scatter of whole blocks of pixels (a cluster-robust "sandwich" estimate).
    """
    axes, seen = faces.axes, np.unique(belongs[belongs != NOWHERE])
    used = belongs != NOWHERE
    side, q, weight = belongs[used], p[used], 1.0 / sigma[used]
    axis = axes[side // 2]
    turn = np.column_stack([-axis[:, 1], axis[:, 0], np.zeros(len(axis))])  # d axis / d yaw
    turn[side == TOP] = 0.0
    value, slope = np.sum(axis * q, axis=1), np.sum(turn * q, axis=1)
    # value + slope * d_yaw = offset
    matrix = np.column_stack([-slope, *[(side == s).astype(float) for s in seen]])
    scaled, target = matrix * weight[:, None], value * weight
    inverse = np.linalg.inv(scaled.T @ scaled)
    solution = inverse @ scaled.T @ target
    scores = scaled * (target - scaled @ solution)[:, None]
    _, group = np.unique(blocks[used] * 5 + side, return_inverse=True)
    sums = np.zeros((group.max() + 1, matrix.shape[1]))
    np.add.at(sums, group, scores)
    deviation = np.sqrt(np.diag(inverse @ (sums.T @ sums) @ inverse))
    offsets, deviations = np.full(5, np.nan), np.full(5, np.nan)
    calibration = np.full(len(seen), settings.depth_error)
    upright = seen != TOP
    calibration[upright] += settings.narrow_error / _widths(q, side, seen[upright], axes)
    offsets[seen], deviations[seen] = solution[1:], np.hypot(deviation[1:], calibration)
    yaw_deviation = float(np.hypot(deviation[0], settings.yaw_error))
    return Faces(faces.origin, faces.yaw + float(solution[0]), yaw_deviation, offsets, deviations)


def _widths(
    q: NDArray[np.float64],
    side: NDArray[np.int64],
    seen: NDArray[np.int64],
    axes: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return how far the points of each face reach, along the shorter of its directions."""
    widths = []
    for face in seen:
        reach = np.ptp(np.percentile(q[side == face] @ axes.T, [2, 98], axis=0), axis=0)
        widths.append(np.delete(reach, face // 2).min())
    return np.array(widths)
