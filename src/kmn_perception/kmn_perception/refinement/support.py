"""Whether the observation supports each body of a fit: what should stand out, and what does."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from kmn_perception.refinement.image import InverseDepthImage, may_hide
from kmn_perception.refinement.problem import Problem
from kmn_perception.refinement.solids import (
    BOTTOM,
    LEFT,
    RIGHT,
    TOP,
    raycast_any,
    raycast_others,
)
from kmn_perception.refinement.support_settings import SupportSettings

GRID = 16  # samples along each side of a body's rectangle
UNKNOWN, BODY, OTHER = range(3)  # where the model has the body, or others, at about that depth


class Support(NamedTuple):
    """What is seen of a body that stands before others.

    Attributes
    ----------
    area
        Pixels that it covers before the others, also where they are out of view.
    missing
        Those of them that show something else, or are seen to be empty.
    unexplained
        Pixels elsewhere on the model from which something stands out as far as the body does, less
        those that lie as far behind: noise does both.
    """

    area: float
    missing: int
    unexplained: int


def unsupported(problem: Problem, values: NDArray[np.float64], names: Sequence[str]) -> str:
    """Return which body the observation contradicts, and how; empty if it contradicts none.

    A body of which nothing is measured is not contradicted: that it is unknown is for the
    covariance to say.

    Parameters
    ----------
    values
        (P,) of the fit.
    names
        Of the bodies.
    """
    settings, solids = problem.settings.support, problem.view(values).solids
    for body, name in enumerate(names):
        found = support_of(solids, problem.image, settings, body)
        if found.area < settings.min_pixels:
            continue
        if found.missing > settings.max_missing * found.area:
            share = found.missing / found.area
            return f"the {name} is not seen where the fit has it: {min(share, 1.0):.0%} of it is missing"
        if found.unexplained > settings.max_unexplained * found.area:
            share = found.unexplained / found.area
            return f"what stands out is no {name}: {share:.0%} of its area stand out beside it"
    return ""


@njit(cache=True, error_model="numpy")
def support_of(
    solids: NDArray[np.float64], image: InverseDepthImage, settings: SupportSettings, body: int
) -> Support:
    """Compare a body with what is seen there, and the others with what stands out from them.

    Depths are averaged over a part of the body, since a single one may be off by as much as the
    body stands out. Distances along the optical axis are taken to the first order.
    """
    area, rise = _area_and_rise(solids, body)
    if area == 0.0:
        return Support(0.0, 0, 0)
    height, width = image.inverse_depth.shape
    left = int(np.ceil(max(solids[:, LEFT].min(), 0.0)))
    right = int(np.floor(min(solids[:, RIGHT].max(), width - 1.0)))
    top = int(np.ceil(max(solids[:, TOP].min(), 0.0)))
    bottom = int(np.floor(min(solids[:, BOTTOM].max(), height - 1.0)))
    rows, columns = max(bottom - top + 1, 0), max(right - left + 1, 0)
    sums, counts = np.zeros((rows + 1, columns + 1)), np.zeros((rows + 1, columns + 1))
    state = np.zeros((rows, columns), dtype=np.int8)
    missing = 0
    for i in range(rows):
        row_sum, row_count = 0.0, 0
        for j in range(columns):
            u, v = float(left + j), float(top + i)
            predicted, entered, _ = raycast_any(solids, u, v)
            seen = float(image.inverse_depth[top + i, left + j])
            if image.farthest <= predicted <= image.nearest and predicted > 0.0:
                before = entered == body and raycast_others(solids, body, u, v) > 0.0
                if seen > 0.0:
                    residual = (seen - predicted) / predicted**2
                    if abs(residual) < settings.farthest * rise:
                        state[i, j] = BODY if before else OTHER if entered != body else UNKNOWN
                        row_sum += residual
                        row_count += 1
                    else:
                        missing += before and residual < 0.0
                elif before and not may_hide(
                    image.occlusion, seen, image.interpolated[top + i, left + j], predicted
                ):
                    missing += 1
            sums[i + 1, j + 1] = sums[i, j + 1] + row_sum
            counts[i + 1, j + 1] = counts[i, j + 1] + row_count
    radius = int(settings.averaged * _short_side(solids, body) / 2.0)
    unexplained = 0
    for i in range(rows):
        low, high = max(i - radius, 0), min(i + radius + 1, rows)
        for j in range(columns):
            if state[i, j] == UNKNOWN:
                continue
            first, last = max(j - radius, 0), min(j + radius + 1, columns)
            count = _within(counts, low, high, first, last)
            residual = _within(sums, low, high, first, last) / count
            if state[i, j] == BODY:
                missing += residual < -settings.distinct * rise
            elif abs(residual) > settings.distinct * rise:
                unexplained += 1 if residual > 0.0 else -1
    return Support(area, missing, unexplained)


@njit(cache=True, error_model="numpy")
def _within(integral: NDArray[np.float64], low: int, high: int, first: int, last: int) -> float:
    """Return the sum over rows low..high and columns first..last of an integral image."""
    return float(
        integral[high, last] - integral[low, last] - integral[high, first] + integral[low, first]
    )


@njit(cache=True, error_model="numpy")
def _short_side(solids: NDArray[np.float64], body: int) -> float:
    """Return the shorter side of a body's rectangle in the image, pixels."""
    return float(
        min(solids[body, RIGHT] - solids[body, LEFT], solids[body, BOTTOM] - solids[body, TOP])
    )


@njit(cache=True, error_model="numpy")
def _area_and_rise(solids: NDArray[np.float64], body: int) -> tuple[float, float]:
    """Return how many pixels a body covers before others, and how far it stands out, metres."""
    wide = solids[body, RIGHT] - solids[body, LEFT]
    high = solids[body, BOTTOM] - solids[body, TOP]
    count, rise = 0, 0.0
    if not np.isfinite(wide * high):
        return 0.0, 0.0
    for i in range(GRID):
        v = solids[body, TOP] + (i + 0.5) / GRID * high
        for j in range(GRID):
            u = solids[body, LEFT] + (j + 0.5) / GRID * wide
            nearest, entered, _ = raycast_any(solids, u, v)
            if entered != body:
                continue
            behind = raycast_others(solids, body, u, v)
            if behind > 0.0:
                count += 1
                rise += (nearest - behind) / behind**2
    return wide * high * count / GRID**2, rise / max(count, 1)
