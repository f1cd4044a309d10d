"""Point clouds rendered anew into a camera (the paper's ``pointCloudToDepth``)."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from kmn_perception.model.camera import Camera
from kmn_perception.model.kinematic_model import KinematicModel

HALF = 0.5
FARTHEST = 1.0 / 256.0  # what is farther than ``far`` still differs from the background


def point_cloud_to_depth(
    model: KinematicModel, points: NDArray[np.float32], transform: NDArray[np.float64]
) -> NDArray[np.float32]:
    """Render the transformed point cloud anew into the model's canonical camera.

    The cloud is splatted into a z-buffer that is finer than the network's image, small holes are
    closed, and blocks are averaged, so that an edge within a pixel shows as a partial value.

    Parameters
    ----------
    points
        (N, 3) in the world frame, metres, finite.
    transform
        (4, 4) affine transformation to apply to the points first: T_theta^-1.

    Returns
    -------
    depth
        (height, width) values in [0, 1]: 0 is the background, 1 the nearest depth.
    """
    image, fine = model.depth_image, model.depth_image.supersampling
    camera = model.camera.resized(image.width * fine, image.height * fine)
    buffer = splat(camera, points, transform, image.max_gap)
    return _normalise(buffer, fine, image.near, image.far)


def splat(
    camera: Camera, points: NDArray[np.float32], transform: NDArray[np.float64], max_gap: int
) -> NDArray[np.float32]:
    """Return the nearest depth in each pixel (height, width), metres; infinite where there is none.

    Parameters
    ----------
    points, transform
        (N, 3) world frame, metres, and the transformation (4, 4) to apply to them first.
    max_gap
        Holes of up to this many pixels are closed.
    """
    matrix = (camera.world_to_camera @ transform)[:3].astype(np.float32)
    matrix[0] = matrix[0] * camera.fx + matrix[2] * camera.cx
    matrix[1] = matrix[1] * camera.fy + matrix[2] * camera.cy
    buffer = np.full((camera.height, camera.width), np.inf, dtype=np.float32)
    v0, v1, u0, u1 = _splat(buffer, points, matrix, camera.near)
    filled = buffer[v0 : v1 + 1, u0 : u1 + 1]
    _close_gaps(filled, max_gap)
    _close_gaps(filled.T, max_gap)
    return buffer


@njit(cache=True)
def _splat(
    buffer: NDArray[np.float32],
    points: NDArray[np.float32],
    matrix: NDArray[np.float32],
    near: float,
) -> tuple[int, int, int, int]:
    """Keep the nearest depth of each pixel; return the rows and columns that were hit."""
    height, width = buffer.shape
    v0, v1, u0, u1 = height, -1, width, -1
    half = np.float32(HALF)
    for i in range(points.shape[0]):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        depth = matrix[2, 0] * x + matrix[2, 1] * y + matrix[2, 2] * z + matrix[2, 3]
        if not depth > near:
            continue
        scale = np.float32(1.0) / depth
        u = (matrix[0, 0] * x + matrix[0, 1] * y + matrix[0, 2] * z + matrix[0, 3]) * scale + half
        v = (matrix[1, 0] * x + matrix[1, 1] * y + matrix[1, 2] * z + matrix[1, 3]) * scale + half
        if not (0.0 <= u < width and 0.0 <= v < height):
            continue
        column, row = int(u), int(v)
        if depth < buffer[row, column]:
            buffer[row, column] = depth
            v0, v1 = min(v0, row), max(v1, row)
            u0, u1 = min(u0, column), max(u1, column)
    return v0, v1, u0, u1


@njit(cache=True)
def _close_gaps(buffer: NDArray[np.float32], max_gap: int) -> None:
    """Fill short runs of empty pixels in each row with the farther of their two ends."""
    height, width = buffer.shape
    for row in range(height):
        last = -1
        for column in range(width):
            if np.isinf(buffer[row, column]):
                continue
            if last >= 0 and 1 < column - last <= max_gap + 1:
                buffer[row, last + 1 : column] = max(buffer[row, last], buffer[row, column])
            last = column


@njit(cache=True)
def _normalise(
    buffer: NDArray[np.float32], block: int, near: float, far: float
) -> NDArray[np.float32]:
    """Map depths linearly to (0, 1], background to 0, and average over blocks of pixels."""
    height, width = buffer.shape[0] // block, buffer.shape[1] // block
    depth = np.zeros((height, width), dtype=np.float32)
    for row in range(height * block):
        for column in range(width * block):
            if not np.isinf(buffer[row, column]):
                value = (far - buffer[row, column]) / (far - near)
                depth[row // block, column // block] += min(1.0, max(FARTHEST, value))
    return depth / np.float32(block * block)


def inverse_depth_of_points(points: NDArray[np.float32], camera: Camera) -> NDArray[np.float32]:
    """Return the inverse depth (height, width) of the nearest point in each pixel, 1 / m.

    Parameters
    ----------
    points
        (N, 3) world frame, metres.

    Returns
    -------
    inverse_depth
        0 where there is no point.
    """
    inverse_depth = np.zeros((camera.height, camera.width), dtype=np.float32)
    _project_nearest(inverse_depth, points, camera.projection, camera.near)
    return inverse_depth


@njit(cache=True)
def _project_nearest(
    inverse_depth: NDArray[np.float32],
    points: NDArray[np.float32],
    matrix: NDArray[np.float64],
    near: float,
) -> None:
    """Keep the nearest point of each pixel."""
    height, width = inverse_depth.shape
    for i in range(points.shape[0]):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        depth = matrix[2, 0] * x + matrix[2, 1] * y + matrix[2, 2] * z + matrix[2, 3]
        if not depth > near:
            continue
        scale = 1.0 / depth
        u = (matrix[0, 0] * x + matrix[0, 1] * y + matrix[0, 2] * z + matrix[0, 3]) * scale + HALF
        v = (matrix[1, 0] * x + matrix[1, 1] * y + matrix[1, 2] * z + matrix[1, 3]) * scale + HALF
        if 0.0 <= u < width and 0.0 <= v < height:
            row, column = int(v), int(u)
            inverse_depth[row, column] = max(inverse_depth[row, column], scale)
