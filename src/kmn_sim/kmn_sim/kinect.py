"""What a Kinect v1 makes of an exact depth image, after measurements of real ones."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from kmn_perception.sensor import DISPARITY_SCALE, DISPARITY_STEP, LATERAL_PIXELS

NOISES = ("none", "kinect")
AXIAL = 1.425e-3  # 1/m; standard deviation by depth^2 (Khoshelham and Elberink, 2012)
# Beside something that is nearer by this many pixels of disparity, a pixel is lost with this
# probability for each pixel of the nearer thing within reach: the window in which the sensor
# correlates sees both. On real frames 2 px are missing beside boxes in the median.
EDGE_STEP, EDGE_REACH, EDGE_LOSS = 1.0, 2, 0.5


def measure(
    depth: NDArray[np.float32], noise: str, generator: np.random.Generator
) -> NDArray[np.float32]:
    """Return an exact depth image (height, width), metres, NaN for none, as it is measured.

    Parameters
    ----------
    noise
        ``none`` or ``kinect``: shadow, lost edges, lateral and axial noise, steps of disparity.
    """
    if noise == "none":
        return depth
    return _blur(_lose(depth, generator), generator)


@njit(cache=True)
def _lose(depth: NDArray[np.float32], generator: np.random.Generator) -> NDArray[np.float32]:
    """Remove what the projector does not light, and pixels beside edges.

    The projector is to the camera's right: its image of a row is shifted by the disparity, and a
    pixel is hidden if one that lies farther right in the camera's image lands left of it.
    """
    height, width = depth.shape
    kept = depth.copy()
    for v in range(height):
        leftmost = np.inf
        for u in range(width - 1, -1, -1):
            if np.isnan(depth[v, u]):
                continue
            lit = u - DISPARITY_SCALE / depth[v, u]
            if lit >= leftmost:
                kept[v, u] = np.nan
            leftmost = min(leftmost, lit)
        for u in range(width):
            if np.isnan(kept[v, u]):
                continue
            for w in range(max(u - EDGE_REACH, 0), min(u + EDGE_REACH + 1, width)):
                step = DISPARITY_SCALE * (1.0 / depth[v, w] - 1.0 / depth[v, u])
                if step > EDGE_STEP and generator.random() < EDGE_LOSS:
                    kept[v, u] = np.nan
                    break
    return kept


@njit(cache=True)
def _blur(depth: NDArray[np.float32], generator: np.random.Generator) -> NDArray[np.float32]:
    """Let every pixel look a little beside itself, and measure that depth with noise, in steps."""
    height, width = depth.shape
    noisy = np.full_like(depth, np.nan)
    for v in range(height):
        for u in range(width):
            row = v + int(np.rint(LATERAL_PIXELS * generator.standard_normal()))
            column = u + int(np.rint(LATERAL_PIXELS * generator.standard_normal()))
            z = depth[min(max(row, 0), height - 1), min(max(column, 0), width - 1)]
            if not np.isnan(z):
                measured = z + AXIAL * z**2 * generator.standard_normal()
                steps = np.rint(DISPARITY_SCALE / measured / DISPARITY_STEP)
                noisy[v, u] = DISPARITY_SCALE / (steps * DISPARITY_STEP)
    return noisy
