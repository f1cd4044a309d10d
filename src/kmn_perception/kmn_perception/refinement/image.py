"""The observation as an image of inverse depth, in the sensor's own pixels."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from kmn_perception.model.observation import Observation, all_free
from kmn_perception.refinement.view import projection

HALF = 0.5
THICKNESS = 0.004  # metres; other objects are at least as thick
INTERPOLATED = 0.01  # metres by which interpolated depths may be wrong
MIN_RANGE = 1e-6  # metres


class InverseDepthImage(NamedTuple):
    """What the sensor saw, in its own pixels.

    Attributes
    ----------
    inverse_depth
        (height, width) 1 / m where the object was seen. Elsewhere it is the negative of the inverse
        depth up to which the pixel was seen to be empty: 0 for all of its line of sight, minus
        infinity where nothing is known.
    interpolated
        (height, width) nothing was measured there.
    pixels
        (N, 3) u, v and inverse depth of all that was seen.
    projection
        (3, 4) map from the world to homogeneous pixels z (u, v, 1).
    upwards
        (4,) such that a point of depth z has the world height ``z * upwards[:3] . (u, v, 1) +
        upwards[3]``.
    floor
        Height in metres up to which points were lost.
    nearest, farthest
        Inverse depths between which the sensor measures, 1 / m.
    """

    inverse_depth: NDArray[np.float32]
    interpolated: NDArray[np.bool_]
    pixels: NDArray[np.float32]
    projection: NDArray[np.float64]
    upwards: NDArray[np.float64]
    floor: float
    nearest: float
    farthest: float


def inverse_depth_image(observation: Observation) -> InverseDepthImage:
    """Put the points back into the pixels from which they came."""
    camera = observation.camera
    matrix = projection(camera)
    around = observation.free_space
    if around is None:
        around = all_free(camera.height, camera.width)
    with np.errstate(divide="ignore"):
        inverse_depth = np.float32(-1.0) / around.free_depth
    pixels = _splat(inverse_depth, observation.points, matrix, camera.near)
    to_world = np.linalg.inv(matrix[:, :3])
    upwards = np.append(to_world[2], camera.pose[2, 3])
    return InverseDepthImage(
        inverse_depth,
        around.interpolated,
        pixels,
        matrix,
        upwards,
        float(observation.floor),
        1.0 / max(camera.near, MIN_RANGE),
        1.0 / camera.far,
    )


@njit(cache=True, error_model="numpy")
def may_hide(seen: float, interpolated: bool, inverse_depth: float) -> bool:
    """Tell whether something may be at an inverse depth, though the pixel does not show it.

    It cannot be just behind what was measured, where the inside of another object is. What is
    interpolated may be the surface of the very object, but not behind it.

    Parameters
    ----------
    seen, interpolated
        The pixel's values in `InverseDepthImage`; the former is not positive.
    """
    margin = -INTERPOLATED if interpolated else THICKNESS
    return seen < 0.0 and 1.0 / inverse_depth > -1.0 / seen + margin


@njit(cache=True)
def _splat(
    inverse_depth: NDArray[np.float32],
    points: NDArray[np.float32],
    matrix: NDArray[np.float64],
    near: float,
) -> NDArray[np.float32]:
    """Keep the nearest point of each pixel; return the pixels hit, in the points' order."""
    height, width = inverse_depth.shape
    pixels = np.empty((points.shape[0], 3), dtype=np.float32)
    count = 0
    for i in range(points.shape[0]):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        depth = matrix[2, 0] * x + matrix[2, 1] * y + matrix[2, 2] * z + matrix[2, 3]
        if not depth > near:
            continue
        scale = 1.0 / depth
        u = (matrix[0, 0] * x + matrix[0, 1] * y + matrix[0, 2] * z + matrix[0, 3]) * scale + HALF
        v = (matrix[1, 0] * x + matrix[1, 1] * y + matrix[1, 2] * z + matrix[1, 3]) * scale + HALF
        if not (0.0 <= u < width and 0.0 <= v < height):
            continue
        column, row = int(u), int(v)
        if inverse_depth[row, column] < scale:
            inverse_depth[row, column] = scale
            pixels[count, 0], pixels[count, 1], pixels[count, 2] = column, row, scale
            count += 1
    return pixels[:count]
