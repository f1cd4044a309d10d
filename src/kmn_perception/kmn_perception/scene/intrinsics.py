"""The pinhole camera that a cloud was taken with, or could have been, from its points alone."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from kmn_perception.model.camera import Camera

MIN_POINTS = 50
STRIDE = 7  # every so many pixels are plenty to fit four numbers
TOLERANCE = 0.5  # pixels; a cloud whose points lie further from their pixels is not of a pinhole
COARSEST = 16  # times coarser than the canonical camera, for clouds without rows and columns
DENSE = 0.9  # share of the pixels with a point whose neighbours have one, too


def camera_of_points(
    points: NDArray[np.float32], to_camera: NDArray[np.float64], pose: NDArray[np.float64]
) -> Camera | None:
    """Return the camera whose pixels are the points, or None if there is no such camera.

    Parameters
    ----------
    points
        (height, width, 3) metres, NaN for none.
    to_camera
        (4, 4) transformation of the points to the optical frame.
    pose
        (4, 4) optical frame in the world frame, for the camera that is returned.
    """
    height, width = points.shape[:2]
    rows, columns = np.arange(0, height, STRIDE), np.arange(0, width, STRIDE)
    drawn = points[::STRIDE, ::STRIDE] @ to_camera[:3, :3].T + to_camera[:3, 3]
    v, u = np.meshgrid(rows, columns, indexing="ij")
    measured = drawn[..., 2] > 0.0
    if measured.sum() < MIN_POINTS:
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


def camera_as_dense(points: NDArray[np.float32], camera: Camera) -> Camera:
    """Return a camera with this view, of as many pixels as the points can fill without holes.

    Parameters
    ----------
    points
        (N, 3) world frame, metres.
    """
    x, y, z = (points @ camera.world_to_camera[:3, :3].T + camera.world_to_camera[:3, 3]).T
    for coarser in range(1, COARSEST):
        candidate = camera.resized(camera.width // coarser, camera.height // coarser)
        u = np.rint(candidate.fx * x / z + candidate.cx).astype(int)
        v = np.rint(candidate.fy * y / z + candidate.cy).astype(int)
        inside = (z > 0.0) & (u >= 0) & (v >= 0) & (u < candidate.width) & (v < candidate.height)
        hit = np.zeros((candidate.height, candidate.width), dtype=bool)
        hit[v[inside], u[inside]] = True
        neighbours = np.concatenate(((hit[:, 1:])[hit[:, :-1]], (hit[1:])[hit[:-1]]))
        if len(neighbours) and neighbours.mean() >= DENSE:
            return candidate
    return camera
