"""The observation as an image of inverse depth, in the sensor's own pixels."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from kmn_perception.model.observation import Observation, all_free
from kmn_perception.refinement.settings import OcclusionSettings

MIN_RANGE = 1e-6  # metres
MEDIAN_TO_SIGMA = 1.4826  # of a normal distribution
SECOND_DIFFERENCE = 6.0**0.5  # standard deviation of x - 2 y + z, in that of x, y and z


class Noise(NamedTuple):
    """Standard deviations of a sensor: of the inverse depth (1 / m), and lateral (pixels)."""

    depth: float
    lateral: float


class InverseDepthImage(NamedTuple):
    """What the sensor saw, in its own pixels.

    Attributes
    ----------
    inverse_depth
        (height, width) 1 / m where the object was seen. Elsewhere it is the negative of the inverse
        depth up to which the pixel's line of sight is free: 0 if all of it is, minus infinity if
        nothing is known.
    interpolated
        (height, width) whether nothing was measured there.
    pixels
        (N, 3) u, v and inverse depth of the pixels that show the object.
    projection
        (3, 4) map from the world to homogeneous pixels z (u, v, 1).
    upwards
        (4,) such that a point of depth z has the world height ``z * upwards[:3] . (u, v, 1) +
        upwards[3]``.
    floor
        Height up to which points were removed with the support plane, metres.
    nearest, farthest
        Inverse depths between which the sensor measures, 1 / m.
    occlusion
        Where the object may be hidden behind something else.
    """

    inverse_depth: NDArray[np.float32]
    interpolated: NDArray[np.bool_]
    pixels: NDArray[np.float32]
    projection: NDArray[np.float64]
    upwards: NDArray[np.float64]
    floor: float
    nearest: float
    farthest: float
    occlusion: OcclusionSettings


def inverse_depth_image(
    observation: Observation, occlusion: OcclusionSettings
) -> InverseDepthImage:
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
        occlusion,
    )


@njit(cache=True, error_model="numpy")
def height_at(upwards: NDArray[np.float64], u: float, v: float, inverse_depth: float) -> float:
    """Return the world height of what a pixel shows at an inverse depth, metres."""
    up = upwards[0] * u + upwards[1] * v + upwards[2]
    return float(up / inverse_depth + upwards[3])


@njit(cache=True, error_model="numpy")
def may_hide(
    occlusion: OcclusionSettings, free: float, interpolated: bool, inverse_depth: float
) -> bool:
    """Return whether a pixel that does not show the object may hide it at an inverse depth.

    It cannot hide it right behind a measured surface, which is that of an object of some thickness.
    An interpolated surface may be that of the object itself.

    Parameters
    ----------
    free, interpolated
        The pixel's values in `InverseDepthImage`; the former is not positive.
    """
    margin = -occlusion.interpolation_error if interpolated else occlusion.min_thickness
    return free < 0.0 and 1.0 / inverse_depth > -1.0 / free + margin


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


def single_pixel_noise(inverse_depth: NDArray[np.float32]) -> float:
    """Return the standard deviation of inverse depths (1 / m), from neighbours along rows.

    A plane's inverse depths change evenly along a row, so that their second differences are those
    of the noise; that of few pixels at edges does not change the median.
    """
    left, middle, right = inverse_depth[:, :-2], inverse_depth[:, 1:-1], inverse_depth[:, 2:]
    measured = (left > 0.0) & (middle > 0.0) & (right > 0.0)
    if not measured.any():
        return 0.0
    second = np.abs(left[measured] - 2.0 * middle[measured] + right[measured])
    return MEDIAN_TO_SIGMA * float(np.median(second)) / SECOND_DIFFERENCE
