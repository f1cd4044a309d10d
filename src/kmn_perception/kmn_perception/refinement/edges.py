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

from kmn_perception.refinement.correlation import correlated_count
from kmn_perception.refinement.image import InverseDepthImage
from kmn_perception.refinement.silhouette import EdgeSettings, half_chord, scan, split
from kmn_perception.refinement.view import PLANES, ModelView, add_normal_equations

MAX_WINDOW = 64  # pixels to either side of an edge
ROOT_HALF = math.sqrt(0.5)
ROOT_TWO_PI = math.sqrt(2.0 * math.pi)
FAR = 6.0  # standard deviations inside its own side, where a pixel says nothing more
LOST = 0.25  # weight of a coarse sample without a step
SUBPIXEL_PHASES = (
    3.0  # an edge that crosses 1/3 of a pixel along its way averages where it cuts the rows
)
LAGS = 32  # samples of an edge that may be shifted alike
EXACT = 0.5  # pixels by which the pixels' grid shifts a step
VISIBLE = 0.5  # share of an edge's samples with a step, from which on it is in view


class EdgeTerms(NamedTuple):
    """Sums over the samples of all edges.

    Attributes
    ----------
    hessian, gradient
        (P, P) and (P,) of the negative log-likelihood (Fisher scoring).
    information
        (P, P) the part of the hessian that comes from edges in view. Others only have bounds.
    loss
        The negative log-likelihood.
    noise_gradient, noise_information
        Its derivative by log s, and the information about log s.
    """

    hessian: NDArray[np.float64]
    gradient: NDArray[np.float64]
    information: NDArray[np.float64]
    loss: float
    noise_gradient: float
    noise_information: float


@njit(cache=True, error_model="numpy")
def edge_terms(
    view: ModelView,
    image: InverseDepthImage,
    settings: EdgeSettings,
    window: float,
    noise: float,
    depth_noise: float,
    border: float,
    most: int,
) -> EdgeTerms:
    """Compare the pixels within ``window`` pixels of each silhouette edge with the edge.

    Parameters
    ----------
    noise
        s in pixels; 0 for a coarse search, in which each sample pulls the edge to the nearest step
        of its row or column with a standard deviation of a third of the window.
    depth_noise
        Of the inverse depth, 1 / m.
    border
        Samples nearer than this to the ends of an edge are left out, pixels.
    most
        At most about so many samples are taken of each edge.
    """
    parameters = view.line_slopes.shape[3]
    hessian, gradient = np.zeros((parameters, parameters)), np.zeros(parameters)
    information, unused = np.zeros((parameters, parameters)), np.zeros(parameters)
    sums = np.zeros(3)  # loss, noise gradient, noise information
    for b in range(view.lines.shape[0]):
        for edge in range(12):
            if view.faces[b, edge] >= 0:
                moment, force = np.zeros((3, 3)), np.zeros(3)
                visible = _add_edge(
                    view, image, settings, window, noise, depth_noise, border, most, b, edge,
                    moment, force, sums,
                )  # fmt: skip
                slopes = view.line_slopes[b, edge]
                add_normal_equations(hessian, gradient, slopes, moment, force)
                if visible:
                    add_normal_equations(information, unused, slopes, moment, force)
    return EdgeTerms(hessian, gradient, information, sums[0], sums[1], sums[2])


@njit(cache=True, error_model="numpy")
def _add_edge(
    view: ModelView,
    image: InverseDepthImage,
    settings: EdgeSettings,
    window: float,
    noise: float,
    depth_noise: float,
    border: float,
    most: int,
    b: int,
    edge: int,
    moment: NDArray[np.float64],
    force: NDArray[np.float64],
    sums: NDArray[np.float64],
) -> bool:
    """Add the samples of an edge, one in each row (or column); tell whether it is in view."""
    solids, lines, all_ends, faces = view.solids, view.lines[b], view.ends[b], view.faces[b]
    inverse_depth, interpolated, upwards = image.inverse_depth, image.interpolated, image.upwards
    lowest = image.floor + settings.floor_margin
    evidence = np.empty(4 * MAX_WINDOW)
    line, ends = lines[edge], all_ends[edge]
    plane = solids[b, PLANES + 3 * faces[edge] : PLANES + 3 * faces[edge] + 3]
    rows = abs(line[0]) >= abs(line[1])
    along = 1 if rows else 0
    extent, width = inverse_depth.shape[1 - along], inverse_depth.shape[along]
    low, high = min(ends[along], ends[2 + along]), max(ends[along], ends[2 + along])
    first = max(0, math.ceil(low + border))
    last = min(extent - 1, math.floor(high - border))
    samples = max(last - first + 1, 1)
    sharpness = max(noise, 1.0 / samples)
    shifts = np.zeros(samples)
    seen, found = 0, 0
    for a in range(first, last + 1, 1 + samples // most):
        position = -(line[along] * a + line[2]) / line[1 - along]
        u, v = (position, float(a)) if rows else (float(a), position)
        at_edge = plane[0] * u + plane[1] * v + plane[2]
        up = upwards[0] * u + upwards[1] * v + upwards[2]
        if not image.farthest < at_edge < image.nearest or up / at_edge + upwards[3] < lowest:
            continue
        chord = half_chord(lines, all_ends, faces, edge, rows, a, position)
        start, step, count = scan(
            solids, inverse_depth, interpolated, settings, depth_noise, b, line[1 - along],
            at_edge, rows, a, position, window, chord, evidence,
        )  # fmt: skip
        if count == 0:
            continue
        seen += 1
        if noise > 0.0:
            _add_probit(
                lines, faces, edge, start, step, a, rows, evidence[:count], sharpness,
                _taper(a, low + border, high - border, border), moment, force, sums,
            )  # fmt: skip
        fewest, most_behind = split(evidence[:count])
        behind = (position - start) * step + 0.5
        has_step = fewest > 0 and most_behind < count
        clipped = start == 0 or start == width - 1
        if has_step:
            found += 1
        elif noise > 0.0 or (most_behind == 0 and clipped):
            continue
        if fewest < behind < most_behind:
            continue  # nothing is known that the edge contradicts
        behind = min(max(behind, fewest), most_behind)
        at = start + step * (behind - 0.5)
        u, v = (at, float(a)) if rows else (float(a), at)
        distance = line[0] * u + line[1] * v + line[2]
        shifts[a - first] = np.sign(distance) * max(abs(distance) - EXACT, 0.0)
        if noise > 0.0:
            weight = 1.0 / (1.0 / 12.0 + noise**2) / samples  # all together, like a single row
        else:
            weight = 9.0 / window**2 / (1.0 + (2.0 * distance / window) ** 2)
            weight *= 1.0 if has_step else LOST
        sums[0] += 0.5 * weight * distance**2
        _add(moment, force, weight, weight * distance, u, v)
    if noise > 0.0:
        span = SUBPIXEL_PHASES * (last - first) * abs(line[along] / line[1 - along])
        weight = 1.0 / (1.0 + moment[2, 2] / (12.0 * (1.0 + span**2)))
        weight *= _independent(shifts)
        moment *= weight
        force *= weight
    return found > VISIBLE * seen


@njit(cache=True, error_model="numpy")
def _independent(shifts: NDArray[np.float64]) -> float:
    """Return the share of an edge's samples that say something of their own.

    The edges of real objects are not quite straight, and a sensor may shift all of one alike.
    """
    alone = (shifts**2).sum()
    return alone / correlated_count(shifts, LAGS) if alone > 0.0 else 1.0


@njit(cache=True, error_model="numpy")
def _taper(a: int, low: float, high: float, border: float) -> float:
    """Return a weight that rises from 0 at the ends of an edge, so that no sample jumps."""
    return min(1.0, (a - low) / border, (high - a) / border) if border > 0.0 else 1.0


@njit(cache=True, error_model="numpy")
def _add_probit(
    lines: NDArray[np.float64],
    faces: NDArray[np.int64],
    edge: int,
    start: int,
    step: int,
    a: int,
    rows: bool,
    evidence: NDArray[np.float64],
    noise: float,
    weight: float,
    moment: NDArray[np.float64],
    force: NDArray[np.float64],
    sums: NDArray[np.float64],
) -> None:
    """Add the likelihood of the pixels of one row (or column)."""
    for k in range(evidence.shape[0]):
        if evidence[k] == 0.0:
            continue
        p = float(start + step * k)
        u, v = (p, float(a)) if rows else (float(a), p)
        sign, sure = np.sign(evidence[k]), abs(evidence[k])
        t = sign * (lines[edge, 0] * u + lines[edge, 1] * v + lines[edge, 2]) / noise
        if t > FAR or _nearer_to_another(lines, faces, edge, u, v):
            continue
        likely = 1.0 - sure + (2.0 * sure - 1.0) * 0.5 * math.erfc(-t * ROOT_HALF)
        density = (2.0 * sure - 1.0) * math.exp(-0.5 * t * t) / ROOT_TWO_PI
        unlikely = 1.0 - likely
        push = density / likely
        information = density * push / unlikely
        sums[0] -= weight * math.log(likely / sure)  # no pixel costs if it fits
        sums[1] += weight * t * push
        sums[2] += weight * t * t * information
        _add(moment, force, weight * information / noise**2, -weight * sign * push / noise, u, v)


@njit(cache=True, error_model="numpy")
def _nearer_to_another(
    lines: NDArray[np.float64], faces: NDArray[np.int64], edge: int, u: float, v: float
) -> bool:
    """Tell whether a pixel lies farther outside of (or less inside) another edge of the body."""
    distance = lines[edge, 0] * u + lines[edge, 1] * v + lines[edge, 2]
    for other in range(12):
        if other == edge or faces[other] < 0:
            continue
        if lines[other, 0] * u + lines[other, 1] * v + lines[other, 2] < distance:
            return True
    return False


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
