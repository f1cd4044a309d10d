"""A common measure of how badly a model explains an observation, wherever it comes from."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from kmn_perception.refinement.image import InverseDepthImage, may_hide
from kmn_perception.refinement.view import ModelView, raycast_any

MOST = 15  # times as many pixels as asked for are looked at in all
DIGITS = 6  # of the share; less is the rounding of the points


@njit(cache=True, error_model="numpy")
def misfit(view: ModelView, image: InverseDepthImage, count: int, depth_scale: float) -> float:
    """Return the share of pixels that the model explains wrongly.

    A pixel that shows something where the model has nothing, or the other way round, counts 1, and
    a wrong depth its square, up to 1; the sum is divided by the number of pixels seen. Where the
    model is out of the sensor's range or may be hidden, nothing need be seen.

    Parameters
    ----------
    count
        About this many of the pixels seen are looked at, and of those that show nothing though the
        model is there.
    depth_scale
        Difference in depth that counts as 1, metres.
    """
    pixels = image.pixels
    stride = max(1, pixels.shape[0] // count)
    wrong, looked = 0.0, 0
    for i in range(0, pixels.shape[0], stride):
        u, v, observed = float(pixels[i, 0]), float(pixels[i, 1]), float(pixels[i, 2])
        predicted = _predicted(view.solids, image, u, v)
        looked += 1
        if predicted > 0.0:
            wrong += min(1.0, ((1.0 / observed - 1.0 / predicted) / depth_scale) ** 2)
        else:
            wrong += 1.0
    unseen = _unseen(view.solids, image, count) / max(pixels.shape[0], 1)
    return round(wrong / max(looked, 1) + unseen, DIGITS)


@njit(cache=True, error_model="numpy")
def _unseen(solids: NDArray[np.float64], image: InverseDepthImage, count: int) -> float:
    """Return the number of pixels that were seen to be empty, though the model is there."""
    inverse_depth, interpolated = image.inverse_depth, image.interpolated
    height, width = inverse_depth.shape
    left, right = max(solids[:, 0].min(), 0.0), min(solids[:, 1].max(), width - 1.0)
    top, bottom = max(solids[:, 2].min(), 0.0), min(solids[:, 3].max(), height - 1.0)
    if left > right or top > bottom:
        return 0.0
    area = max(image.pixels.shape[0], height * width // MOST)
    step = max(1, int(np.sqrt(area / count)))  # the same for all views, so that none is favoured
    unseen = 0
    for row in range(int(np.ceil(top / step)) * step, int(bottom) + 1, step):
        for column in range(int(np.ceil(left / step)) * step, int(right) + 1, step):
            seen = float(inverse_depth[row, column])
            if seen <= 0.0:
                predicted = _predicted(solids, image, float(column), float(row))
                unseen += predicted > 0.0 and not may_hide(
                    seen, interpolated[row, column], predicted
                )
    return float(unseen * step**2)


@njit(cache=True, error_model="numpy")
def _predicted(solids: NDArray[np.float64], image: InverseDepthImage, u: float, v: float) -> float:
    """Return the inverse depth at which a pixel should show the model, 0 if it should not."""
    predicted, _, _ = raycast_any(solids, u, v)
    if predicted < image.farthest or predicted > image.nearest:
        return 0.0
    up = image.upwards
    height = (up[0] * u + up[1] * v + up[2]) / predicted + up[3]
    return predicted if height >= image.floor else 0.0
