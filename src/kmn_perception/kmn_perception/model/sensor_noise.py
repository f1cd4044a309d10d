"""Effects of real depth sensors, applied to exact depth images."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from kmn_perception.model.depth_sensor import DepthSensor

NOISES = ("none", "mm", "kinect")


def add_noise(
    depth: NDArray[np.float32], noise: str, generator: np.random.Generator
) -> NDArray[np.float32]:
    """Return a depth image (height, width), metres, NaN for none, as a sensor would measure it.

    Parameters
    ----------
    noise
        ``none``; ``mm``: steps of 1 mm; ``kinect``: a Kinect v1 with lateral noise that frays the
        edges, axial noise (Nguyen et al.), and the steps of its disparity.
    """
    if noise == "none":
        return depth
    if noise == "mm":
        return (np.round(depth * 1e3) / 1e3).astype(np.float32)
    sensor = DepthSensor.load("kinect_v1")
    disparity = sensor.disparity
    return _kinect(
        depth, sensor.lateral, *sensor.nguyen, disparity.scale, disparity.step, generator
    )


@njit(cache=True)
def _kinect(
    depth: NDArray[np.float32],
    lateral: float,
    offset: float,
    slope: float,
    centre: float,
    scale: float,
    step: float,
    generator: np.random.Generator,
) -> NDArray[np.float32]:
    """Let every pixel look a little beside itself, and measure that depth with noise, in steps."""
    height, width = depth.shape
    noisy = np.full_like(depth, np.nan)
    v0, v1, u0, u1 = _window(depth, reach=4)
    for v in range(v0, v1):
        for u in range(u0, u1):
            row = v + int(np.rint(lateral * generator.standard_normal()))
            column = u + int(np.rint(lateral * generator.standard_normal()))
            z = depth[min(max(row, 0), height - 1), min(max(column, 0), width - 1)]
            if not np.isnan(z):
                sigma = offset + slope * (z - centre) ** 2
                disparity = scale / (z + sigma * generator.standard_normal())
                noisy[v, u] = scale / (np.rint(disparity / step) * step)
    return noisy


@njit(cache=True)
def _window(depth: NDArray[np.float32], reach: int) -> tuple[int, int, int, int]:
    """Return the rows and columns that hold all measurements, and ``reach`` pixels around."""
    height, width = depth.shape
    v0, v1, u0, u1 = height, 0, width, 0
    for v in range(height):
        for u in range(width):
            if not np.isnan(depth[v, u]):
                v0, v1, u0, u1 = min(v0, v), max(v1, v + 1), min(u0, u), max(u1, u + 1)
    return max(v0 - reach, 0), min(v1 + reach, height), max(u0 - reach, 0), min(u1 + reach, width)
