"""How well the model's silhouette edges part the pixels that show a body from those that do not.

Every pixel beside an edge shows either the body or what lies behind it. With d its distance to the
edge (pixels, positive inside) it shows the body with the probability Phi(d / s), where s is the
lateral noise of the sensor: a probit regression, of which exact data (s -> 0) leave the set of all
edges that part the pixels without error.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from kmn_perception.refinement.geometry import View, add_normal_equations, meet
from kmn_perception.refinement.image import Image

LARGEST_WINDOW = 64  # pixels to either side of an edge
ROOT_HALF, ROOT_TWO_PI = math.sqrt(0.5), math.sqrt(2.0 * math.pi)
BODY, BEHIND, UNKNOWN = 1, -1, 0


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
    """

    occluder: float
    background: float
    contrast: float
    floor_margin: float
    outliers: float


class EdgeTerms(NamedTuple):
    """Sums over the samples of all edges.

    Attributes
    ----------
    hessian, gradient
        (P, P) and (P,) of the negative log-likelihood (Fisher scoring).
    loss
        The negative log-likelihood.
    noise_gradient, noise_information
        Its derivative by log s, and the information about log s.
    found, lost
        (B,) number of samples of each body at which there is a step, and there is none.
    """

    hessian: NDArray[np.float64]
    gradient: NDArray[np.float64]
    loss: float
    noise_gradient: float
    noise_information: float
    found: NDArray[np.int64]
    lost: NDArray[np.int64]


@njit(cache=True, error_model="numpy")
def edge_terms(
    view: View, image: Image, settings: EdgeSettings, window: float, noise: float
) -> EdgeTerms:
    """Compare the pixels within ``window`` pixels of each silhouette edge with the edge.

    Parameters
    ----------
    noise
        s in pixels; 0 for a coarse search, in which each sample pulls the edge to the nearest step
        of its row or column with a standard deviation of a third of the window.
    """
    solids, lines, all_ends, faces = view.solids, view.lines, view.ends, view.faces
    inverse_depth, upwards, floor = image.inverse_depth, image.upwards, image.floor
    bodies, parameters = lines.shape[0], view.line_slopes.shape[3]
    hessian, gradient = np.zeros((parameters, parameters)), np.zeros(parameters)
    found, lost = np.zeros(bodies, dtype=np.int64), np.zeros(bodies, dtype=np.int64)
    sums = np.zeros(3)  # loss, noise gradient, noise information
    classes = np.empty(4 * LARGEST_WINDOW, dtype=np.int64)
    height, width = inverse_depth.shape
    for b in range(bodies):
        for edge in range(12):
            if faces[b, edge] < 0:
                continue
            moment, force = np.zeros((3, 3)), np.zeros(3)
            line, ends = lines[b, edge], all_ends[b, edge]
            plane = solids[b, 4 + 3 * faces[b, edge] : 7 + 3 * faces[b, edge]]
            rows = abs(line[0]) >= abs(line[1])  # one sample in each row, else in each column
            along = 1 if rows else 0
            across = 1 - along
            first = max(0, math.ceil(min(ends[along], ends[2 + along])))
            extent = height if rows else width
            last = min(extent - 1, math.floor(max(ends[along], ends[2 + along])))
            sharpness = max(noise, 1.0 / (last - first + 1)) if last >= first else noise
            for a in range(first, last + 1):
                position = -(line[along] * a + line[2]) / line[across]
                u, v = (position, float(a)) if rows else (float(a), position)
                at_edge = plane[0] * u + plane[1] * v + plane[2]
                up = upwards[0] * u + upwards[1] * v + upwards[2]
                if up / at_edge + upwards[3] < floor + settings.floor_margin or at_edge <= 0.0:
                    continue
                chord = _half_chord(lines[b], all_ends[b], faces[b], edge, a, position, rows)
                start, step, count = _scan(
                    solids, inverse_depth, settings, b, line, at_edge, a, position, rows,
                    window, chord, classes,
                )  # fmt: skip
                if count == 0:
                    continue
                if noise == 0.0:
                    weight = 9.0 / window**2
                else:
                    weight = 12.0 / (last - first + 1)
                    _probit(
                        line, start, step, a, rows, classes[:count], sharpness, settings.outliers,
                        moment, force, sums,
                    )  # fmt: skip
                split = _split(classes[:count])
                clipped = start <= 0 or start >= (width if rows else height) - 1
                if split == 0 and clipped:
                    continue
                if 0 < split < count:
                    found[b] += 1
                else:
                    lost[b] += 1
                    if noise > 0.0:
                        continue
                    weight *= 0.25
                at = start + step * (split - 0.5)
                u, v = (at, float(a)) if rows else (float(a), at)
                distance = line[0] * u + line[1] * v + line[2]
                if noise == 0.0:
                    weight /= 1.0 + (2.0 * distance / window) ** 2
                sums[0] += 0.5 * weight * distance**2
                _add(moment, force, weight, weight * distance, u, v)
            slopes = view.line_slopes[b, edge]
            add_normal_equations(hessian, gradient, slopes, moment, force)
    return EdgeTerms(hessian, gradient, sums[0], sums[1], sums[2], found, lost)


@njit(cache=True, error_model="numpy")
def _scan(
    solids: NDArray[np.float64],
    inverse_depth: NDArray[np.float32],
    settings: EdgeSettings,
    b: int,
    line: NDArray[np.float64],
    at_edge: float,
    a: int,
    position: float,
    rows: bool,
    window: float,
    chord: float,
    classes: NDArray[np.int64],
) -> tuple[int, int, int]:
    """Classify the pixels of row (or column) ``a`` around an edge, from outside to inside.

    Returns
    -------
    start, step, count
        The outermost pixel, the step inwards (1 or -1) and the number of pixels.
    """
    slope = line[0] if rows else line[1]
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
    count = (stop - start) * step + 1
    for k in range(count):
        p = start + step * k
        column, row = (p, a) if rows else (a, p)
        expected, _ = meet(solids, b, float(column), float(row))
        if expected == 0.0:
            expected = at_edge
        seen = float(inverse_depth[row, column])
        classes[k] = _classify(solids, settings, b, float(column), float(row), seen, expected)
    return start, step, max(count, 0)


@njit(cache=True, error_model="numpy")
def _half_chord(
    lines: NDArray[np.float64],
    ends: NDArray[np.float64],
    faces: NDArray[np.int64],
    edge: int,
    a: int,
    position: float,
    rows: bool,
) -> float:
    """Return half the way along a row (or column) to the other side of the silhouette."""
    along = 1 if rows else 0
    step = 1.0 if lines[edge, 1 - along] > 0.0 else -1.0
    nearest = np.inf
    for other in range(12):
        if other == edge or faces[other] < 0:
            continue
        low, high = ends[other, along], ends[other, 2 + along]
        if min(low, high) <= a <= max(low, high):
            slope = lines[other, 1 - along]
            if abs(slope) > 1e-9:
                at = -(lines[other, along] * a + lines[other, 2]) / slope
                if (at - position) * step > 0.0:
                    nearest = min(nearest, (at - position) * step)
    return 0.5 * nearest


@njit(cache=True, error_model="numpy")
def _classify(
    solids: NDArray[np.float64],
    settings: EdgeSettings,
    b: int,
    u: float,
    v: float,
    seen: float,
    expected: float,
) -> int:
    """Tell whether a pixel shows the body, at the inverse depth expected, or what is behind it."""
    behind = 0.0
    for other in range(solids.shape[0]):
        if other != b:
            met, _ = meet(solids, other, u, v)
            if met > expected:
                return UNKNOWN
            behind = max(behind, met)
    if seen == 0.0:
        return BEHIND
    depth = 1.0 / seen - 1.0 / expected
    if depth < -settings.occluder:
        return UNKNOWN
    if behind > 0.0:
        gap = 1.0 / behind - 1.0 / expected
        if gap < settings.contrast:
            return UNKNOWN
        return BODY if depth < 0.5 * gap else BEHIND
    return BODY if depth < settings.background else BEHIND


@njit(cache=True, error_model="numpy")
def _split(classes: NDArray[np.int64]) -> int:
    """Return how many pixels, from outside, to put behind so that the fewest are wrong."""
    cost = 0
    for k in range(classes.shape[0]):
        if classes[k] == BEHIND:
            cost += 1
    least, best = cost, 0
    for k in range(classes.shape[0]):
        cost += classes[k]
        if cost < least:
            least, best = cost, k + 1
    return best


@njit(cache=True, error_model="numpy")
def _probit(
    line: NDArray[np.float64],
    start: int,
    step: int,
    a: int,
    rows: bool,
    classes: NDArray[np.int64],
    noise: float,
    outliers: float,
    moment: NDArray[np.float64],
    force: NDArray[np.float64],
    sums: NDArray[np.float64],
) -> None:
    """Add the likelihood of the pixels of one row (or column)."""
    for k in range(classes.shape[0]):
        if classes[k] == UNKNOWN:
            continue
        p = float(start + step * k)
        u, v = (p, float(a)) if rows else (float(a), p)
        sign = float(classes[k])
        t = sign * (line[0] * u + line[1] * v + line[2]) / noise
        if t > 6.0:
            continue
        likely = outliers + (1.0 - 2.0 * outliers) * 0.5 * math.erfc(-t * ROOT_HALF)
        density = (1.0 - 2.0 * outliers) * math.exp(-0.5 * t * t) / ROOT_TWO_PI
        push = density / likely
        information = density * push / (1.0 - likely)
        sums[0] -= math.log(likely)
        sums[1] += t * push
        sums[2] += t * t * information
        _add(moment, force, information / noise**2, -sign * push / noise, u, v)


@njit(cache=True, error_model="numpy")
def _add(
    moment: NDArray[np.float64],
    force: NDArray[np.float64],
    weight: float,
    pull: float,
    u: float,
    v: float,
) -> None:
    """Add one pixel to the moments of its edge."""
    moment[0, 0] += weight * u * u
    moment[0, 1] += weight * u * v
    moment[1, 0] += weight * u * v
    moment[0, 2] += weight * u
    moment[2, 0] += weight * u
    moment[1, 1] += weight * v * v
    moment[1, 2] += weight * v
    moment[2, 1] += weight * v
    moment[2, 2] += weight
    force[0] += pull * u
    force[1] += pull * v
    force[2] += pull
