"""What a Kinect v1 misses: the projector's shadow beside objects, and pixels at their edges."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from kmn_perception.sensor import DISPARITY_SCALE, add_noise

NOISES = ("none", "kinect")
# Where the disparity steps by this many pixels there is an edge; beside it a pixel is lost with
# this probability, as on the real frames where 2 px are missing beside boxes in the median.
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
    return add_noise(_lose(depth, generator), noise, generator)


@njit(cache=True)
def _lose(depth: NDArray[np.float32], generator: np.random.Generator) -> NDArray[np.float32]:
    """Remove what the projector does not light, which is to the camera's right, and frayed edges.

    The projector's image of a row is the row shifted by the disparity. Seen from the right, a
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
                step = DISPARITY_SCALE * abs(1.0 / depth[v, w] - 1.0 / depth[v, u])
                if (np.isnan(step) or step > EDGE_STEP) and generator.random() < EDGE_LOSS:
                    kept[v, u] = np.nan
                    break
    return kept
