"""Boxes from an object's points without a model: what the estimates are compared with."""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np
from numpy.typing import NDArray

from kmn_perception.experiments.settings import BaselineSettings
from kmn_perception.experiments.upright_box import UprightBox

Baseline = Callable[[NDArray[np.float32], BaselineSettings], UprightBox]

MM = 1000.0  # OpenCV's rectangles are found in millimetres, for the sake of single precision


def open3d_box(points: NDArray[np.float32], settings: BaselineSettings) -> UprightBox:
    """Return open3d's smallest oriented bounding box; its z is the axis nearest to vertical."""
    import open3d

    cloud = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(points.astype(np.float64)))
    box = cloud.get_minimal_oriented_bounding_box(robust=True)  # also flat ones
    up = int(np.argmax(np.abs(box.R[2])))
    first, second = (axis for axis in range(3) if axis != up)
    yaw = float(np.arctan2(box.R[1, first], box.R[0, first]))
    return UprightBox(np.array(box.center), np.array(box.extent)[[first, second, up]], yaw)


def upright_rectangle(points: NDArray[np.float32], settings: BaselineSettings) -> UprightBox:
    """Return the upright box on the smallest rectangle around the points, from z = 0 to the top."""
    (x, y), (width, depth), degrees = cv2.minAreaRect(points[:, :2] * np.float32(MM))
    top = float(points[:, 2].max())
    centre = np.array([x / MM, y / MM, top / 2.0])
    return UprightBox(centre, np.array([width / MM, depth / MM, top]), float(np.radians(degrees)))


def plane_fit(points: NDArray[np.float32], settings: BaselineSettings) -> UprightBox:
    """Return the upright box along the largest upright plane, around all points, from z = 0.

    The plane is found by RANSAC with a fixed seed.
    """
    random = np.random.default_rng(0)
    a, b, c = points[random.integers(len(points), size=(3, settings.hypotheses))].astype(np.float64)
    normals = np.cross(b - a, c - a)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    level = np.abs(normals[:, 2]) < settings.level
    yaw = 0.0
    if level.any():
        normals, a = normals[level], a[level]
        distances = np.abs(points @ normals.T - np.sum(normals * a, axis=1))
        best = normals[np.argmax((distances < settings.plane_distance).sum(axis=0))]
        yaw = float(np.arctan2(best[1], best[0]))
    return _around(points, yaw)


def _around(points: NDArray[np.float32], yaw: float) -> UprightBox:
    """Return the upright box of a yaw that holds all points, from z = 0 to the top."""
    cos, sin = np.cos(yaw), np.sin(yaw)
    axes = np.array([[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]])
    own = points @ axes.T
    low, high = own.min(axis=0), own.max(axis=0)
    low[2] = 0.0
    return UprightBox((low + high) / 2.0 @ axes, high - low, yaw)


BASELINES: dict[str, Baseline] = {
    "open3d_oriented_bounding_box": open3d_box,
    "plane_fit": plane_fit,
    "upright_rectangle": upright_rectangle,
}
