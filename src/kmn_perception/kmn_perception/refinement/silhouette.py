"""Which pixels beside a silhouette edge show the body, and which show what lies behind it."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from kmn_perception.refinement.edge_settings import EdgeSettings
from kmn_perception.refinement.image import InverseDepthImage, Noise, may_hide
from kmn_perception.refinement.solids import (
    inverse_depth_at,
    raycast,
    raycast_any,
    raycast_others,
)

MIN_SLOPE = 1e-9  # of an edge that crosses a row at all
ROOT_HALF = math.sqrt(0.5)
TINY = 1e-300
MAX_LOG_RATIO = 100.0  # of likelihoods; nothing is more certain


class Crossing(NamedTuple):
    """Where an edge crosses a row of pixels, or a column.

    Attributes
    ----------
    horizontal
        Whether it crosses a row rather than a column.
    number
        Of the row (or column).
    position
        Column (or row) of the crossing.
    slope
        Change of the distance to the edge from one pixel of the row (or column) to the next.
    inverse_depth
        Of the edge at the crossing, 1 / m.
    """

    horizontal: bool
    number: int
    position: float
    slope: float
    inverse_depth: float


class Strip(NamedTuple):
    """The pixels of a row (or column) around an edge, from outside to inside.

    Attributes
    ----------
    start, step
        The outermost pixel, and the step inwards (1 or -1).
    evidence
        (K,) positive where a pixel shows the body, negative where it shows something behind it, 0
        where neither is known. Its absolute value is the probability that this is right.
    """

    start: int
    step: int
    evidence: NDArray[np.float64]


@njit(cache=True, error_model="numpy")
def crossing_of(
    solids: NDArray[np.float64],
    body: int,
    face: int,
    line: NDArray[np.float64],
    number: int,
) -> Crossing:
    """Return where the edge of a face crosses a row, or a column if the edge is rather horizontal.

    Parameters
    ----------
    line
        (3,) of the edge, see `ModelView`.
    """
    horizontal = abs(line[0]) >= abs(line[1])
    along, across = (line[1], line[0]) if horizontal else (line[0], line[1])
    position = -(along * number + line[2]) / across
    u, v = (position, float(number)) if horizontal else (float(number), position)
    return Crossing(
        horizontal, number, position, across, inverse_depth_at(solids, body, face, u, v)
    )


@njit(cache=True, error_model="numpy")
def pixel(crossing: Crossing, position: float) -> tuple[float, float]:
    """Return u and v of a position in the row (or column) of a crossing."""
    if crossing.horizontal:
        return position, float(crossing.number)
    return float(crossing.number), position


@njit(cache=True, error_model="numpy")
def strip_around(
    solids: NDArray[np.float64],
    image: InverseDepthImage,
    settings: EdgeSettings,
    noise: Noise,
    body: int,
    face: int,
    crossing: Crossing,
    reach: tuple[float, float],
    buffer: NDArray[np.float64],
) -> Strip:
    """Classify the pixels around the crossing of a body's edge.

    There are none where the body stands out by less than ``settings.contrast`` at the edge.

    Parameters
    ----------
    noise
        Standard deviations of the inverse depth, and lateral; 0: pixels look where they should.
    face
        Of which all pixels of the body are, as at creases (see `ModelView`); -1: those that rays
        meet.
    reach
        How far to look outwards and inwards, pixels.
    buffer
        Memory for the evidence.
    """
    beside = raycast_others(solids, body, *pixel(crossing, crossing.position))
    if beside > 0.0 and 1.0 / beside - 1.0 / crossing.inverse_depth < settings.contrast:
        return Strip(0, 1, buffer[:0])
    inverse_depth, interpolated = image.inverse_depth, image.interpolated
    position, horizontal, number = crossing.position, crossing.horizontal, crossing.number
    outwards, inwards = reach
    step = 1 if crossing.slope > 0.0 else -1
    last = (inverse_depth.shape[1] if horizontal else inverse_depth.shape[0]) - 1
    if step > 0:
        start = max(math.ceil(position - outwards), 0)
        stop = min(math.floor(position + inwards), last)
    else:
        start = min(math.floor(position + outwards), last)
        stop = max(math.ceil(position - inwards), 0)
    count = max((stop - start) * step + 1, 0)
    front, _, _ = raycast_any(solids, *pixel(crossing, float(start + step * (count - 1))))
    end = _end_of_others(solids, body, crossing, start, step) if beside > 0.0 else -np.inf
    for k in range(count):
        p = start + step * k
        column, row = (p, number) if horizontal else (number, p)
        entered, _ = raycast(solids, body, float(column), float(row))
        expected = entered
        if face >= 0:
            expected = inverse_depth_at(solids, body, face, float(column), float(row))
        if expected <= 0.0:
            expected = crossing.inverse_depth
        seen = float(inverse_depth[row, column])
        if seen <= 0.0 and may_hide(image.occlusion, seen, interpolated[row, column], expected):
            buffer[k] = 0.0
            continue
        behind = raycast_others(solids, body, float(column), float(row))
        others = 1.0
        if seen > 0.0 and end > -np.inf and noise.lateral > 0.0:
            distance = (p - position) * step * abs(crossing.slope) / noise.lateral
            empty = normal_probability(end * abs(crossing.slope) / noise.lateral - distance)
            outside = max(normal_probability(-distance), TINY)
            others = max(1.0 - empty / outside, settings.outliers)
        if behind > expected and (beside > 0.0 or entered == 0.0):
            buffer[k] = 0.0  # another body is in front
            continue
        farthest = min(expected, crossing.inverse_depth)
        buffer[k] = _evidence(
            settings, noise.depth, others, seen, expected, farthest, behind, beside, front
        )
        if interpolated[row, column]:
            buffer[k] *= settings.interpolated
    return Strip(start, step, buffer[:count])


@njit(cache=True, error_model="numpy")
def _evidence(
    settings: EdgeSettings,
    depth_noise: float,
    others: float,
    seen: float,
    expected: float,
    farthest: float,
    behind: float,
    beside: float,
    front: float,
) -> float:
    """Return the evidence that a pixel shows the body rather than what is behind it, see `Strip`.

    Parameters
    ----------
    others
        Probability that a pixel that does not show the body shows another one and not nothing.
    seen, expected, farthest, behind, beside, front
        Inverse depths: of the pixel, of the body there, of the farther one of that and the edge, of
        the model's other bodies there, of those behind the edge, and of what the model shows inside
        the edge (0 if there is none).
    """
    certain = 1.0 - settings.outliers
    if seen <= 0.0:
        return -certain
    if behind > expected:
        return certain  # beyond the edge is nothing, and a body in front of this one is not that
    depth = 1.0 / seen - 1.0 / expected
    margin = settings.distinct * depth_noise
    if depth < -settings.occluder and seen > expected + margin:
        is_model = front > 0.0 and 1.0 / seen > 1.0 / front - settings.occluder
        return certain if is_model and behind == 0.0 and beside == 0.0 else 0.0
    if behind == 0.0:
        if 1.0 / seen - 1.0 / farthest > settings.background and seen < farthest - margin:
            return -certain
        if beside == 0.0:
            return certain
        behind = beside  # the border of another body, which a sensor frays, is not this one
    if 1.0 / behind - 1.0 / expected < settings.contrast:
        return 0.0
    middle, gap = 0.5 * (expected + behind), expected - behind
    log_odds = (seen - middle) * gap / depth_noise**2 - math.log(others)
    probability = min(1.0 / (1.0 + math.exp(-min(abs(log_odds), MAX_LOG_RATIO))), certain)
    return probability if log_odds > 0.0 else -probability


@njit(cache=True, error_model="numpy")
def _end_of_others(
    solids: NDArray[np.float64], body: int, crossing: Crossing, start: int, step: int
) -> float:
    """Return where, outside an edge, no other body is behind it any more.

    A negative number of pixels from the crossing; minus infinity if the others reach beyond the
    strip. A pixel that looks there by mistake shows nothing, so that one that shows something is
    the more likely to show the body.
    """
    p = math.ceil(crossing.position) - 1 if step > 0 else math.floor(crossing.position) + 1
    while (p - start) * step >= 0:
        if raycast_others(solids, body, *pixel(crossing, float(p))) == 0.0:
            return (p - crossing.position) * step + 0.5
        p -= step
    return -np.inf


@njit(cache=True, error_model="numpy")
def normal_probability(x: float) -> float:
    """Return the probability that a standard normal variable is smaller than x."""
    return 0.5 * math.erfc(-x * ROOT_HALF)


@njit(cache=True, error_model="numpy")
def half_chord(
    lines: NDArray[np.float64],
    ends: NDArray[np.float64],
    faces: NDArray[np.int64],
    edge: int,
    crossing: Crossing,
) -> float:
    """Return half the distance along a row (or column) to the other side of a body's silhouette."""
    along = 1 if crossing.horizontal else 0
    step = 1.0 if crossing.slope > 0.0 else -1.0
    nearest = np.inf
    for other in range(12):
        if other == edge or faces[other] < 0:
            continue
        low, high = ends[other, along], ends[other, 2 + along]
        slope = lines[other, 1 - along]
        if min(low, high) <= crossing.number <= max(low, high) and abs(slope) > MIN_SLOPE:
            position = -(lines[other, along] * crossing.number + lines[other, 2]) / slope
            distance = (position - crossing.position) * step
            if distance > 0.0:
                nearest = min(nearest, distance)
    return 0.5 * nearest


@njit(cache=True, error_model="numpy")
def split(evidence: NDArray[np.float64]) -> tuple[int, int]:
    """Return how many pixels, from outside, show what is behind so that the fewest are wrong.

    The minimum and the maximum number differ where nothing is known of the pixels between them.
    """
    cost = 0
    for k in range(evidence.shape[0]):
        if evidence[k] < 0.0:
            cost += 1
    min_cost, first, last = cost, 0, 0
    for k in range(evidence.shape[0]):
        cost += int(np.sign(evidence[k]))
        if cost < min_cost:
            min_cost, first, last = cost, k + 1, k + 1
        elif cost == min_cost and last == k and evidence[k] == 0.0:
            last = k + 1
    return first, last
