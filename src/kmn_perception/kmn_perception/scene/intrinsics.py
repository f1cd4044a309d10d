"""The pinhole camera that a cloud was taken with, or could have been, from its points alone."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from kmn_perception.model.camera import Camera
from kmn_perception.scene.settings import IntrinsicsSettings


def camera_of_points(
    points: NDArray[np.float32], to_camera: NDArray[np.float64], settings: IntrinsicsSettings
) -> Camera | None:
    """Return the camera whose pixels are the points, or None if there is no such camera.

    Parameters
    ----------
    points
        (height, width, 3) metres, NaN for none.
    to_camera
        (4, 4) transformation of the points to the optical frame.

    Returns
    -------
    camera
        With the identity as its pose.
    """
    height, width = points.shape[:2]
    stride = settings.stride
    rows, columns = np.arange(0, height, stride), np.arange(0, width, stride)
    drawn = points[::stride, ::stride] @ to_camera[:3, :3].T + to_camera[:3, 3]
    v, u = np.meshgrid(rows, columns, indexing="ij")
    measured = drawn[..., 2] > 0.0
    if measured.sum() < settings.min_points:
        return None
    ray = drawn[measured][:, :2] / drawn[measured][:, 2:]
    pixel = np.stack((u[measured], v[measured]), axis=1).astype(np.float64)
    spread = ray.std(axis=0)
    if spread.min() < 1e-6:
        return None
    centred, mean = ray - ray.mean(axis=0), pixel.mean(axis=0)
    focal = (centred * (pixel - mean)).mean(axis=0) / spread**2
    centre = mean - focal * ray.mean(axis=0)
    if np.abs(focal * ray + centre - pixel).max() > settings.tolerance or focal.min() <= 0.0:
        return None
    return Camera(
        width=width,
        height=height,
        fx=float(focal[0]),
        fy=float(focal[1]),
        cx=float(centre[0]),
        cy=float(centre[1]),
        pose=np.eye(4),
    )


def camera_as_dense(
    points: NDArray[np.float32], camera: Camera, settings: IntrinsicsSettings
) -> Camera:
    """Return a camera with this view, of as many pixels as the points can fill without holes.

    Parameters
    ----------
    points
        (N, 3) world frame, metres.
    """
    for coarser in range(1, settings.max_coarsening):
        candidate = camera.resized(camera.width // coarser, camera.height // coarser)
        pixels = candidate.project(points)
        inside = pixels[:, 2] > 0.0
        u, v = np.rint(pixels[inside, :2]).astype(int).T
        within = (u >= 0) & (v >= 0) & (u < candidate.width) & (v < candidate.height)
        hit = np.zeros((candidate.height, candidate.width), dtype=bool)
        hit[v[within], u[within]] = True
        neighbours = np.concatenate(((hit[:, 1:])[hit[:, :-1]], (hit[1:])[hit[:-1]]))
        if len(neighbours) and neighbours.mean() >= settings.dense:
            return candidate
    return camera
