"""What a depth sensor makes of an exact depth image, by the description of its kind."""

from __future__ import annotations

from collections.abc import Sequence
from statistics import NormalDist

import cv2
import numpy as np
from numba import njit
from numpy.typing import NDArray

from kmn_perception.model.depth_sensor import DepthSensor

# Names of kinds of noise, and those of their files in config/sensors.
SENSORS = {
    "kinect": "kinect_v1",
    "d455": "d455",
    "d435": "d435",
    "azure_kinect": "azure_kinect",
}


class NoisySensor:
    """A sensor with noise of its own.

    Its lateral noise acts at edges only: on a surface matching averages.

    Parameters
    ----------
    sensor
        How sensors of its kind measure.
    seed
        Of the noise.
    offset
        Its own error of calibration: by this its inverse depth is too small, 1/m.
    """

    def __init__(self, sensor: DepthSensor, seed: int | Sequence[int], offset: float = 0.0) -> None:
        self._sensor = sensor
        self._offset = offset
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
            The same with fat, frayed and lost edges, shadows, axial noise and steps of the
            disparity, holes, borders, and nothing beyond the range.
        """
        sensor, generator = self._sensor, self._generator
        scale, edge, shadow = sensor.disparity.scale, sensor.edge, sensor.shadow
        fat = _fatten(depth, scale, edge.step, edge.fattening)
        seen = _jitter(fat, scale, edge.step, sensor.lateral, generator)
        kept = seen.copy()
        _cast_shadow(fat[:, ::-1], kept[:, ::-1], fx * shadow.right, shadow.filled)
        _cast_shadow(fat, kept, fx * shadow.left, shadow.filled)
        _lose_edges(fat, kept, scale, edge.step, edge.loss, generator)
        correlation = sensor.axial.correlation
        alike = _smooth_noise(depth.shape, correlation.length, generator)
        measured = _quantise(
            kept,
            self._offset,
            sensor.axial.inverse,
            np.sqrt(1.0 - correlation.share),
            np.sqrt(correlation.share) * alike,
            scale,
            sensor.disparity.step,
            generator,
        )
        if shadow.gaps:
            _open_gaps(measured, fx * shadow.left)
        _leave_out(measured, sensor, generator)
        return measured


def _smooth_noise(
    shape: tuple[int, ...], length: float, generator: np.random.Generator
) -> NDArray[np.float32]:
    """Return Gaussian noise of deviation 1 whose correlation falls to 1 / e at a length in pixels.

    White noise, smoothed by a Gaussian of half that length; 0 everywhere for a length of 0.
    """
    if length == 0.0:
        return np.zeros(shape, dtype=np.float32)
    margin = int(np.ceil(2.0 * length))
    height, width = shape[0] + 2 * margin, shape[1] + 2 * margin
    white = generator.standard_normal((height, width), dtype=np.float32)
    kernel = cv2.getGaussianKernel(2 * margin + 1, length / 2.0, cv2.CV_32F)
    smooth = cv2.sepFilter2D(white, -1, kernel, kernel)[margin:-margin, margin:-margin]
    return (smooth / np.float32((kernel**2).sum())).astype(np.float32)


def _leave_out(
    depth: NDArray[np.float32], sensor: DepthSensor, generator: np.random.Generator
) -> None:
    """Remove holes, borders, and what is beyond the range."""
    holes = sensor.holes
    if holes.fraction > 0.0:
        level = NormalDist().inv_cdf(1.0 - holes.fraction)
        depth[_smooth_noise(depth.shape, holes.size, generator) > level] = np.nan
    if sensor.border > 0:
        top, bottom, left, right = generator.integers(0, sensor.border, 4, endpoint=True)
        depth[:top] = depth[len(depth) - bottom :] = np.nan
        depth[:, :left] = depth[:, depth.shape[1] - right :] = np.nan
    near, far = sensor.range
    depth[(depth < near) | (depth > far)] = np.nan


def _fatten(
    depth: NDArray[np.float32], scale: float, step: float, width: float
) -> NDArray[np.float32]:
    """Let what is nearer by at least a step of disparity grow by a width in pixels."""
    if width == 0.0:
        return depth
    filled = np.nan_to_num(depth, nan=np.inf)
    size = 2 * int(np.rint(width)) + 1
    nearest = cv2.erode(filled, np.ones((size, size), dtype=np.uint8))
    jumps = scale / nearest - scale / filled >= step
    return np.where(jumps, nearest, depth).astype(np.float32)


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
def _open_gaps(depth: NDArray[np.float32], scale: float) -> None:
    """Remove pixels that no whole pixel of the left viewpoint, of a disparity scale, falls onto."""
    for v in range(depth.shape[0]):
        for u in range(depth.shape[1] - 1):
            here, there = u + scale / depth[v, u], u + 1.0 + scale / depth[v, u + 1]
            if there > here and np.floor(here) == np.floor(there):
                depth[v, u] = np.nan


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
    offset: float,
    axial: float,
    alone: float,
    alike: NDArray[np.float32],
    scale: float,
    step: float,
    generator: np.random.Generator,
) -> NDArray[np.float32]:
    """Add the error of calibration and axial noise, and round the disparity to its steps."""
    measured = np.full_like(depth, np.nan)
    for v in range(depth.shape[0]):
        for u in range(depth.shape[1]):
            z = depth[v, u]
            if not np.isnan(z):
                z /= 1.0 - offset * z
                noise = alone * generator.standard_normal() + alike[v, u]
                noisy = z + axial * z**2 * noise
                if step > 0.0:
                    noisy = scale / (np.rint(scale / noisy / step) * step)
                measured[v, u] = noisy
    return measured
