"""The observation as an image of inverse depth, in the sensor's own pixels."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from kmn_perception.model.observation import Observation, all_free

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
    """Return what the sensor saw of the object, and of the space around it."""
    camera = observation.camera
    matrix = camera.projection
    around = observation.free_space
    if around is None:
        around = all_free(camera.height, camera.width)
    with np.errstate(divide="ignore"):
        inverse_depth = np.float32(-1.0) / around.free_depth
    pixels = _overlay(inverse_depth, observation.inverse_depth)
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
def _overlay(inverse_depth: NDArray[np.float32], seen: NDArray[np.float32]) -> NDArray[np.float32]:
    """Put what is seen of the object over the rest; return its pixels (N, 3)."""
    height, width = seen.shape
    pixels = np.empty((height * width, 3), dtype=np.float32)
    count = 0
    for row in range(height):
        for column in range(width):
            scale = seen[row, column]
            if scale > 0.0:
                inverse_depth[row, column] = scale
                pixels[count, 0], pixels[count, 1], pixels[count, 2] = column, row, scale
                count += 1
    return pixels[:count].copy()
