"""The pinhole camera that an organised cloud was taken with, from its points alone."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from kmn_perception.camera import Camera

LEAST_POINTS = 50
STRIDE = 7  # every so many pixels are plenty to fit four numbers
TOLERANCE = 0.5  # pixels; a cloud whose points lie further from their pixels is not of a pinhole


def camera_of_points(points: NDArray[np.float32], pose: NDArray[np.float64]) -> Camera | None:
    """Return the camera whose pixels are the points, or None if there is no such camera.

    Parameters
    ----------
    points
        (height, width, 3) optical frame, metres, NaN for none.
    pose
        (4, 4) optical frame in the world frame, for the camera that is returned.
    """
    height, width = points.shape[:2]
    rows, columns = np.arange(0, height, STRIDE), np.arange(0, width, STRIDE)
    drawn = points[::STRIDE, ::STRIDE].astype(np.float64)
    v, u = np.meshgrid(rows, columns, indexing="ij")
    measured = drawn[..., 2] > 0.0
    if measured.sum() < LEAST_POINTS:
        return None
    ray = drawn[measured][:, :2] / drawn[measured][:, 2:]
    pixel = np.stack((u[measured], v[measured]), axis=1).astype(np.float64)
    spread = ray.std(axis=0)
    if spread.min() < 1e-6:
        return None
    centred, mean = ray - ray.mean(axis=0), pixel.mean(axis=0)
    focal = (centred * (pixel - mean)).mean(axis=0) / spread**2
    centre = mean - focal * ray.mean(axis=0)
    if np.abs(focal * ray + centre - pixel).max() > TOLERANCE or focal.min() <= 0.0:
        return None
    return Camera(
        width=width,
        height=height,
        fx=float(focal[0]),
        fy=float(focal[1]),
        cx=float(centre[0]),
        cy=float(centre[1]),
        pose=pose,
    )
