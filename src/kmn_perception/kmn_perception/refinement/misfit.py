"""A common measure of how badly a model explains an observation, wherever it comes from."""

from __future__ import annotations

import numpy as np
from numba import njit

from kmn_perception.refinement.geometry import View, meet_any
from kmn_perception.refinement.image import Image

DIGITS = 6  # of the share; less is the rounding of the points
MOST = 15  # times the number of pixels asked for are looked at


@njit(cache=True, error_model="numpy")
def misfit(view: View, image: Image, count: int, depth_scale: float) -> float:
    """Return the share of pixels that the model explains wrongly.

    On a regular grid, a pixel that shows something where the model has nothing, or the other way
    round, counts 1, and a wrong depth its square, up to 1; the sum is divided by the number of
    pixels seen. Where the model is out of the sensor's range, nothing need be seen.

    Parameters
    ----------
    count
        About this many of the observed pixels lie on the grid.
    depth_scale
        Difference in depth that counts as 1, metres.
    """
    solids, inverse_depth, pixels = view.solids, image.inverse_depth, image.pixels
    up, base, floor = image.upwards, image.upwards[3], image.floor
    nearest, farthest = image.nearest, image.farthest
    height, width = inverse_depth.shape
    step = max(1, int(np.sqrt(max(pixels.shape[0] / count, height * width / (MOST * count)))))
    wrong, seen = 0.0, 0
    for row in range(step // 2, height, step):
        for column in range(step // 2, width, step):
            observed = float(inverse_depth[row, column])
            predicted, _, _ = meet_any(solids, float(column), float(row))
            if predicted > 0.0:
                high = (up[0] * column + up[1] * row + up[2]) / predicted + base
                if high < floor:
                    predicted = 0.0
            measurable = farthest <= predicted <= nearest
            if observed > 0.0:
                seen += 1
            if observed > 0.0 and measurable:
                wrong += min(1.0, ((1.0 / observed - 1.0 / predicted) / depth_scale) ** 2)
            elif observed > 0.0 or measurable:
                wrong += 1.0
    return round(wrong / max(seen, 1), DIGITS)
