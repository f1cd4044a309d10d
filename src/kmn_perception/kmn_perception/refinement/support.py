"""Whether the observation supports a fit: each body is where it is seen, and nothing else is."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from kmn_perception.refinement.image import InverseDepthImage, Noise, may_hide
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
UNKNOWN = -1  # in place of a body's number


class Residuals(NamedTuple):
    """How far what is measured stands out from the model, where that is little.

    Attributes
    ----------
    bodies
        (rows, columns) of the image's part with the model: which body it has there; `UNKNOWN` where
        there is none, nothing is measured, or something else is.
    depths
        (rows, columns) of the model, metres; 0 where there is none.
    sums, counts
        (rows + 1, columns + 1) integral images of the distances, metres along the optical axis to
        the first order, and of the pixels that have one.
    missing
        (B,) pixels of each body that show something far behind it, or are seen to be empty.
    """

    bodies: NDArray[np.int8]
    depths: NDArray[np.float64]
    sums: NDArray[np.float64]
    counts: NDArray[np.float64]
    missing: NDArray[np.int64]


def unsupported(
    problem: Problem, values: NDArray[np.float64], noise: Noise, names: Sequence[str]
) -> str:
    """Return what the observation contradicts in a fit, and how; empty if nothing.

    A body of which nothing is measured is not contradicted: that it is unknown is for the
    covariance to say.

    Parameters
    ----------
    values
        (P,) of the fit.
    noise
        Of the sensor, as estimated.
    names
        Of the bodies.
    """
    settings, solids = problem.settings.support, problem.view(values).solids
    residuals = residuals_of(solids, problem.image, settings)
    frayed = round(settings.frayed * noise.lateral)
    certain = problem.settings.edges.distinct * noise.depth / problem.inverse_depth_per_metre
    unexplained = ""
    for body, name in enumerate(names):
        area, rise = _area_and_rise(solids, body)
        if rise == 0.0 or area < settings.min_pixels:
            continue
        sides = solids[body, [RIGHT, BOTTOM]] - solids[body, [LEFT, TOP]]
        radius = int(0.5 * settings.averaged * sides.min())
        distinct = max(settings.distinct * rise, certain / (2 * radius + 1))
        if _lies_deeper(residuals, body, settings.absent * rise, certain):
            return f"the {name} is not seen where the fit has it: what is there lies behind it"
        missing, beside = _compare(residuals, body, distinct, radius, frayed)
        if missing > settings.max_missing * area:
            share = min(missing / area, 1.0)
            return f"the {name} is not seen where the fit has it: {share:.0%} of it is missing"
        if beside > settings.max_unexplained * area:
            share = beside / area
            unexplained = f"what stands out is no {name}: {share:.0%} of its area is beside it"
    share = _relief(residuals, settings)
    if share > settings.max_relief:
        relief = f"more than {settings.relief:g} m before or behind the model"
        return f"{share:.0%} of what is seen lies {relief}: it is of another shape"
    return unexplained


@njit(cache=True, error_model="numpy")
def residuals_of(
    solids: NDArray[np.float64], image: InverseDepthImage, settings: SupportSettings
) -> Residuals:
    """Compare the pixels in which the model is with what is measured there."""
    height, width = image.inverse_depth.shape
    left = int(np.ceil(max(solids[:, LEFT].min(), 0.0)))
    right = int(np.floor(min(solids[:, RIGHT].max(), width - 1.0)))
    top = int(np.ceil(max(solids[:, TOP].min(), 0.0)))
    bottom = int(np.floor(min(solids[:, BOTTOM].max(), height - 1.0)))
    rows, columns = max(bottom - top + 1, 0), max(right - left + 1, 0)
    sums, counts = np.zeros((rows + 1, columns + 1)), np.zeros((rows + 1, columns + 1))
    bodies = np.full((rows, columns), UNKNOWN, dtype=np.int8)
    depths = np.zeros((rows, columns))
    missing = np.zeros(solids.shape[0], dtype=np.int64)
    for i in range(rows):
        row_sum, row_count = 0.0, 0
        for j in range(columns):
            u, v = float(left + j), float(top + i)
            predicted, body, _ = raycast_any(solids, u, v)
            seen = float(image.inverse_depth[top + i, left + j])
            if body >= 0 and image.farthest <= predicted <= image.nearest:
                depths[i, j] = 1.0 / predicted
                residual = (seen - predicted) / predicted**2
                if seen <= 0.0:
                    missing[body] += not may_hide(
                        image.occlusion, seen, image.interpolated[top + i, left + j], predicted
                    )
                elif abs(residual) < settings.something_else:
                    bodies[i, j] = body
                    row_sum += residual
                    row_count += 1
                else:
                    missing[body] += residual < 0.0
            sums[i + 1, j + 1] = sums[i, j + 1] + row_sum
            counts[i + 1, j + 1] = counts[i, j + 1] + row_count
    return Residuals(bodies, depths, sums, counts, missing)


@njit(cache=True, error_model="numpy")
def _mean(residuals: Residuals, row: int, column: int, radius: int) -> float:
    """Return the mean distance over a square around a pixel that has one."""
    rows, columns = residuals.bodies.shape
    low, high = max(row - radius, 0), min(row + radius + 1, rows)
    first, last = max(column - radius, 0), min(column + radius + 1, columns)
    sums, counts = residuals.sums, residuals.counts
    total = sums[high, last] - sums[low, last] - sums[high, first] + sums[low, first]
    count = counts[high, last] - counts[low, last] - counts[high, first] + counts[low, first]
    return float(total / count)


@njit(cache=True, error_model="numpy")
def _compare(
    residuals: Residuals, body: int, distinct: float, radius: int, frayed: int
) -> tuple[int, int]:
    """Return how many pixels of a body do not show it, and in how many others something stands out.

    Pixels are not judged if the model's own depth is another one ``frayed`` pixels beside them: a
    sensor may look there.

    Depths are averaged over a square, since a single one may be off by as much as the body stands
    out. Noise lets as many pixels stand out as lie behind, which are subtracted.
    """
    missing, unexplained = residuals.missing[body], 0
    rows, columns = residuals.bodies.shape
    for i in range(rows):
        for j in range(columns):
            entered = residuals.bodies[i, j]
            if entered == UNKNOWN:
                continue
            mean = _mean(residuals, i, j, radius)
            if abs(mean) <= distinct or _changes(residuals.depths, i, j, frayed, distinct):
                continue
            if entered == body:
                missing += mean < 0.0
            else:
                unexplained += 1 if mean > 0.0 else -1
    return missing, unexplained


@njit(cache=True, error_model="numpy")
def _lies_deeper(residuals: Residuals, body: int, distance: float, certain: float) -> bool:
    """Return whether the pixels of a body lie deeper by ``distance`` metres on average.

    Parameters
    ----------
    certain
        By which a single pixel must differ to be certain, metres.
    """
    total, count = 0.0, 0
    rows, columns = residuals.bodies.shape
    for i in range(rows):
        for j in range(columns):
            if residuals.bodies[i, j] == body:
                total += _mean(residuals, i, j, 0)
                count += 1
    return count > 0 and -total / count > max(distance, certain / math.sqrt(count))


@njit(cache=True, error_model="numpy")
def _changes(depths: NDArray[np.float64], i: int, j: int, reach: int, distinct: float) -> bool:
    """Return whether the model's depth changes by ``distinct`` metres within ``reach`` pixels."""
    rows, columns = depths.shape
    for row in range(max(i - reach, 0), min(i + reach + 1, rows)):
        for column in range(max(j - reach, 0), min(j + reach + 1, columns)):
            if depths[row, column] > 0.0 and abs(depths[row, column] - depths[i, j]) > distinct:
                return True
    return False


@njit(cache=True, error_model="numpy")
def _relief(residuals: Residuals, settings: SupportSettings) -> float:
    """Return the share of the pixels that stand out or lie deeper, with what noise does taken off.

    Noise does both alike; a frame or a deeper field does one.
    """
    count, higher, deeper = 0, 0, 0
    rows, columns = residuals.bodies.shape
    for i in range(rows):
        for j in range(columns):
            if residuals.bodies[i, j] != UNKNOWN:
                mean = _mean(residuals, i, j, settings.relief_radius)
                count += 1
                higher += mean > settings.relief
                deeper += mean < -settings.relief
    return abs(higher - deeper) / max(count, 1)


@njit(cache=True, error_model="numpy")
def _area_and_rise(solids: NDArray[np.float64], body: int) -> tuple[float, float]:
    """Return how many pixels show a body, in view or not, and how far it stands out, metres.

    It stands out where other bodies are behind it; 0 if they are nowhere.
    """
    wide = solids[body, RIGHT] - solids[body, LEFT]
    high = solids[body, BOTTOM] - solids[body, TOP]
    if not np.isfinite(wide * high):
        return 0.0, 0.0
    count, before, rise = 0, 0, 0.0
    for i in range(GRID):
        v = solids[body, TOP] + (i + 0.5) / GRID * high
        for j in range(GRID):
            u = solids[body, LEFT] + (j + 0.5) / GRID * wide
            nearest, entered, _ = raycast_any(solids, u, v)
            if entered != body:
                continue
            count += 1
            behind = raycast_others(solids, body, u, v)
            if behind > 0.0:
                before += 1
                rise += (nearest - behind) / behind**2
    return wide * high * count / GRID**2, rise / max(before, 1)
