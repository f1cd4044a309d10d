"""What a Kinect v1 makes of an exact depth image, after measurements of real ones."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from kmn_perception.model.kinect_v1 import KinectV1

NOISES = ("none", "kinect")


class Kinect:
    """A sensor with noise of its own.

    Its lateral noise acts at edges only: on a surface matching averages.

    Parameters
    ----------
    sensor
        How it measures.
    seed
        Of the noise.
    """

    def __init__(self, sensor: KinectV1, seed: int) -> None:
        self._sensor = sensor
        self._generator = np.random.default_rng(seed)

    def measure(self, depth: NDArray[np.float32], fx: float) -> NDArray[np.float32]:
        """Return what is measured of an exact depth image.

        Parameters
        ----------
        depth
            (height, width) metres, NaN for none.
        fx
            Focal length of the image along its rows, pixels.

        Returns
        -------
        depth
            The same with shadows, lost and frayed edges, axial noise and steps of the disparity.
        """
        sensor, generator = self._sensor, self._generator
        scale, edge, shadow = sensor.disparity.scale, sensor.edge, sensor.shadow
        seen = _jitter(depth, scale, edge.step, sensor.lateral, generator)
        kept = seen.copy()
        _cast_shadow(depth[:, ::-1], kept[:, ::-1], fx * shadow.projector, shadow.filled)
        _cast_shadow(depth, kept, fx * shadow.infrared, shadow.filled)
        _lose_edges(depth, kept, scale, edge.step, edge.loss, generator)
        return _quantise(kept, sensor.axial.khoshelham, scale, sensor.disparity.step, generator)


@njit(cache=True)
def _jitter(
    depth: NDArray[np.float32],
    scale: float,
    step: float,
    sigma: float,
    generator: np.random.Generator,
) -> NDArray[np.float32]:
    """Let every pixel near an edge look a little beside itself."""
    height, width = depth.shape
    seen = depth.copy()
    for v in range(height):
        for u in range(width):
            row = v + int(np.rint(sigma * generator.standard_normal()))
            column = u + int(np.rint(sigma * generator.standard_normal()))
            z = depth[min(max(row, 0), height - 1), min(max(column, 0), width - 1)]
            # On a surface the sensor averages, and its noise is the axial one.
            if not abs(scale / z - scale / depth[v, u]) < step:
                seen[v, u] = z
    return seen


@njit(cache=True)
def _cast_shadow(
    depth: NDArray[np.float32], kept: NDArray[np.float32], scale: float, filled: float
) -> None:
    """Remove what is hidden from a second viewpoint to the left, of a given disparity scale.

    Its image of a row is shifted by the disparity: a pixel is hidden if one that lies farther left
    in the camera's image lands right of it.
    """
    height, width = depth.shape
    for v in range(height):
        rightmost = -np.inf
        for u in range(width):
            if np.isnan(depth[v, u]):
                continue
            shifted = u + scale / depth[v, u]
            if shifted <= rightmost - filled:
                kept[v, u] = np.nan
            rightmost = max(rightmost, shifted)


@njit(cache=True)
def _lose_edges(
    depth: NDArray[np.float32],
    kept: NDArray[np.float32],
    scale: float,
    step: float,
    loss: float,
    generator: np.random.Generator,
) -> None:
    """Remove some of the pixels just beside something nearer."""
    height, width = depth.shape
    for v in range(height):
        for u in range(width):
            for w in (max(u - 1, 0), min(u + 1, width - 1)):
                nearer = scale / depth[v, w] - scale / depth[v, u]
                if nearer > step and generator.random() < loss:
                    kept[v, u] = np.nan


@njit(cache=True)
def _quantise(
    depth: NDArray[np.float32],
    axial: float,
    scale: float,
    step: float,
    generator: np.random.Generator,
) -> NDArray[np.float32]:
    """Add axial noise, and round the disparity to its steps."""
    measured = np.full_like(depth, np.nan)
    for v in range(depth.shape[0]):
        for u in range(depth.shape[1]):
            z = depth[v, u]
            if not np.isnan(z):
                noisy = z + axial * z**2 * generator.standard_normal()
                measured[v, u] = scale / (np.rint(scale / noisy / step) * step)
    return measured
