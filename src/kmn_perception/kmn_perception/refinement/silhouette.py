"""Which pixels beside a silhouette edge show the body, and which show what lies behind it."""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray
from pydantic import Field

from kmn_perception.configuration.settings import Fraction, NonNegative
from kmn_perception.refinement.image import may_hide
from kmn_perception.refinement.view import raycast

CERTAIN = 5.0  # standard deviations that tell two depths apart
MOST = 100.0  # of a log-likelihood ratio


class EdgeSettings(NamedTuple):
    """What tells a body from what lies before and behind it.

    Attributes
    ----------
    occluder
        What lies this much before the edge belongs to something else, metres.
    background
        So does what lies this much behind it where the model has nothing, metres.
    contrast
        Least step in depth that tells two bodies apart, metres.
    floor_margin
        Edges less than this above the floor are not used, metres.
    outliers
        Share of pixels that show anything.
    interpolated
        Of the probability, where nothing was measured.
    """

    occluder: NonNegative
    background: NonNegative
    contrast: NonNegative
    floor_margin: NonNegative
    outliers: Annotated[float, Field(gt=0.0, lt=0.5)]
    interpolated: Fraction


@njit(cache=True, error_model="numpy")
def scan(
    solids: NDArray[np.float64],
    inverse_depth: NDArray[np.float32],
    interpolated: NDArray[np.bool_],
    settings: EdgeSettings,
    depth_noise: float,
    b: int,
    slope: float,
    at_edge: float,
    rows: bool,
    a: int,
    position: float,
    window: float,
    chord: float,
    evidence: NDArray[np.float64],
) -> tuple[int, int, int]:
    """Classify the pixels of row (or column) ``a`` around an edge, from outside to inside.

    Parameters
    ----------
    slope
        Change of the distance to the edge from pixel to pixel.
    at_edge, position
        Inverse depth of the edge, and where it crosses the row.
    window, chord
        How far to look to either side, and how far inside at most, in pixels.
    evidence
        Is filled in: positive where the body is seen, negative where something behind it is, 0
        where neither is known. Its amount is the probability that this is right.

    Returns
    -------
    start, step, count
        The outermost pixel, the step inwards (1 or -1) and the number of pixels.
    """
    step = 1 if slope > 0.0 else -1
    reach = window / abs(slope)
    inwards = min(reach, chord)
    last = (inverse_depth.shape[1] if rows else inverse_depth.shape[0]) - 1
    if step > 0:
        start = max(math.ceil(position - reach), 0)
        stop = min(math.floor(position + inwards), last)
    else:
        start = min(math.floor(position + reach), last)
        stop = max(math.ceil(position - inwards), 0)
    count = max((stop - start) * step + 1, 0)
    for k in range(count):
        p = start + step * k
        column, row = (p, a) if rows else (a, p)
        expected, _ = raycast(solids, b, float(column), float(row))
        if expected == 0.0:
            expected = at_edge
        seen = float(inverse_depth[row, column])
        if seen <= 0.0 and may_hide(seen, interpolated[row, column], expected):
            evidence[k] = 0.0
            continue
        evidence[k] = _evidence(
            solids, settings, depth_noise, b, float(column), float(row), seen, expected
        )
        if interpolated[row, column]:
            evidence[k] *= settings.interpolated
    return start, step, count


@njit(cache=True, error_model="numpy")
def _evidence(
    solids: NDArray[np.float64],
    settings: EdgeSettings,
    depth_noise: float,
    b: int,
    u: float,
    v: float,
    seen: float,
    expected: float,
) -> float:
    """Tell whether a pixel shows the body, at the inverse depth expected, or what is behind it."""
    certain = 1.0 - settings.outliers
    behind = 0.0
    for other in range(solids.shape[0]):
        if other != b:
            met, _ = raycast(solids, other, u, v)
            if met > expected:
                return 0.0
            behind = max(behind, met)
    if seen <= 0.0:
        return -certain
    depth = 1.0 / seen - 1.0 / expected
    if depth < -settings.occluder and seen > expected + CERTAIN * depth_noise:
        return 0.0
    if behind == 0.0:
        beyond = depth > settings.background and seen < expected - CERTAIN * depth_noise
        return -certain if beyond else certain
    if 1.0 / behind - 1.0 / expected < settings.contrast:
        return 0.0
    middle, gap = 0.5 * (expected + behind), expected - behind
    ratio = math.exp(-min(abs(seen - middle) * gap / depth_noise**2, MOST))
    sure = min(1.0 / (1.0 + ratio), certain)
    return sure if seen > middle else -sure


@njit(cache=True, error_model="numpy")
def half_chord(
    lines: NDArray[np.float64],
    ends: NDArray[np.float64],
    faces: NDArray[np.int64],
    edge: int,
    rows: bool,
    a: int,
    position: float,
) -> float:
    """Return half the way along a row (or column) to the other side of a body's silhouette."""
    along = 1 if rows else 0
    step = 1.0 if lines[edge, 1 - along] > 0.0 else -1.0
    nearest = np.inf
    for other in range(12):
        if other == edge or faces[other] < 0:
            continue
        low, high = ends[other, along], ends[other, 2 + along]
        slope = lines[other, 1 - along]
        if min(low, high) <= a <= max(low, high) and abs(slope) > 1e-9:
            at = -(lines[other, along] * a + lines[other, 2]) / slope
            if (at - position) * step > 0.0:
                nearest = min(nearest, (at - position) * step)
    return 0.5 * nearest


@njit(cache=True, error_model="numpy")
def split(evidence: NDArray[np.float64]) -> tuple[int, int]:
    """Return how many pixels, from outside, to put behind so that the fewest are wrong.

    The least and the largest number differ where nothing is known of the pixels between them.
    """
    cost = 0
    for k in range(evidence.shape[0]):
        if evidence[k] < 0.0:
            cost += 1
    cheapest, first, last = cost, 0, 0
    for k in range(evidence.shape[0]):
        cost += int(np.sign(evidence[k]))
        if cost < cheapest:
            cheapest, first, last = cost, k + 1, k + 1
        elif cost == cheapest and last == k and evidence[k] == 0.0:
            last = k + 1
    return first, last
