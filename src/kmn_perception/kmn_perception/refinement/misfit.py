"""A common measure of how badly values explain an observation, wherever they come from."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from kmn_perception.refinement.image import InverseDepthImage, height_at, may_hide
from kmn_perception.refinement.settings import MisfitSettings
from kmn_perception.refinement.solids import BOTTOM, LEFT, RIGHT, TOP, raycast_any
from kmn_perception.refinement.view import ModelView


@njit(cache=True, error_model="numpy")
def misfit(
    view: ModelView, image: InverseDepthImage, settings: MisfitSettings, count: int
) -> float:
    """Return the fraction of pixels that the model explains wrongly.

    A pixel that shows the object where the model has nothing, or the other way round, counts 1, and
    a wrong depth its square, up to 1; the sum is divided by the number of pixels that show the
    object. Where the model is out of the sensor's range or may be hidden, it need not be seen.

    Parameters
    ----------
    count
        Approximate number of pixels that are compared, of those that show the object and of those
        that show nothing though the model is there.
    """
    pixels = image.pixels
    stride = max(1, pixels.shape[0] // count)
    wrong, compared = 0.0, 0
    for i in range(0, pixels.shape[0], stride):
        u, v, observed = float(pixels[i, 0]), float(pixels[i, 1]), float(pixels[i, 2])
        predicted = _predicted(view.solids, image, u, v)
        compared += 1
        if predicted > 0.0:
            wrong += min(1.0, ((1.0 / observed - 1.0 / predicted) / settings.depth) ** 2)
        else:
            wrong += 1.0
    unseen = _unseen(view.solids, image, settings, count) / max(pixels.shape[0], 1)
    return round(wrong / max(compared, 1) + unseen, settings.digits)


@njit(cache=True, error_model="numpy")
def _unseen(
    solids: NDArray[np.float64], image: InverseDepthImage, settings: MisfitSettings, count: int
) -> float:
    """Return the number of pixels that should show the model but do not."""
    inverse_depth, interpolated = image.inverse_depth, image.interpolated
    height, width = inverse_depth.shape
    left, right = max(solids[:, LEFT].min(), 0.0), min(solids[:, RIGHT].max(), width - 1.0)
    top, bottom = max(solids[:, TOP].min(), 0.0), min(solids[:, BOTTOM].max(), height - 1.0)
    if left > right or top > bottom:
        return 0.0
    area = max(image.pixels.shape[0], height * width // settings.max_area)
    step = max(1, int(np.sqrt(area / count)))  # the same for all views, so that none is favoured
    unseen = 0
    for row in range(int(np.ceil(top / step)) * step, int(bottom) + 1, step):
        for column in range(int(np.ceil(left / step)) * step, int(right) + 1, step):
            seen = float(inverse_depth[row, column])
            if seen <= 0.0:
                predicted = _predicted(solids, image, float(column), float(row))
                unseen += predicted > 0.0 and not may_hide(
                    image.occlusion, seen, interpolated[row, column], predicted
                )
    return float(unseen * step**2)


@njit(cache=True, error_model="numpy")
def _predicted(solids: NDArray[np.float64], image: InverseDepthImage, u: float, v: float) -> float:
    """Return the inverse depth at which a pixel should show the model, 0 if it should not."""
    predicted, _, _ = raycast_any(solids, u, v)
    if predicted < image.farthest or predicted > image.nearest:
        return 0.0
    return predicted if height_at(image.upwards, u, v, predicted) >= image.floor else 0.0
