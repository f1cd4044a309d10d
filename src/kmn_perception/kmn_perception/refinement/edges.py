"""How well the model's silhouette edges separate the pixels that show a body from the others.

Every pixel beside an edge shows either the body or what lies behind it. With d its distance to the
edge (pixels, positive inside) it shows the body with the probability Phi(d / s), where s is the
lateral noise of the sensor. This is a probit regression; for exact data (s -> 0), all edges that
separate the pixels without error are equally likely.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from kmn_perception.refinement.correlation import newey_west_variance
from kmn_perception.refinement.edge_settings import EdgeSettings
from kmn_perception.refinement.image import InverseDepthImage, Noise, height_at
from kmn_perception.refinement.probit import EdgeSums, add_pixel, add_probit
from kmn_perception.refinement.silhouette import (
    Crossing,
    Strip,
    crossing_of,
    half_chord,
    pixel,
    split,
    strip_around,
)
from kmn_perception.refinement.view import ModelView, add_normal_equations

HALF_PIXEL = 0.5  # by which the grid of the pixels shifts a step
ROUNDING_INFORMATION = 12.0  # the inverse variance of rounding to whole pixels
SEARCH_DEVIATIONS = 3.0  # standard deviations to the limits of a level of the coarse search


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
    independent
        Fraction of the samples in view that are independent of each other, if each edge as a
        whole may lie off by the settings' bias.
    """

    hessian: NDArray[np.float64]
    gradient: NDArray[np.float64]
    information: NDArray[np.float64]
    loss: float
    noise_gradient: float
    noise_information: float
    independent: float


class EdgeSampling(NamedTuple):
    """Which pixels are compared with the edges, and how.

    Attributes
    ----------
    noise
        Standard deviations of the inverse depth and s. s = 0 stands for a coarse search, in which
        each sample pulls the edge to the nearest step of its row or column, with a standard
        deviation of a third of the window.
    window
        Distance to either side of an edge within which pixels count.
    border
        Samples closer than this to the ends of an edge are left out, pixels.
    max_samples
        Approximate maximum number of samples of each edge.
    max_crease
        Half the width of the face that ends in a crease at most, pixels: the depths of a wider one
        tell where it is.
    shape_error
        Standard deviation by which a whole edge lies or leans off the model's, pixels.
    """

    noise: Noise
    window: float
    border: float
    max_samples: int
    max_crease: float
    shape_error: float


class AddedEdge(NamedTuple):
    """Whether an edge is in view, by how many samples, and which fraction is independent."""

    visible: bool
    samples: int
    independent: float


@njit(cache=True, error_model="numpy")
def edge_terms(
    view: ModelView, image: InverseDepthImage, settings: EdgeSettings, sampling: EdgeSampling
) -> EdgeTerms:
    """Compare the pixels beside each silhouette edge with the edge."""
    parameters = view.line_jacobians.shape[3]
    hessian, gradient = np.zeros((parameters, parameters)), np.zeros(parameters)
    information, unused = np.zeros((parameters, parameters)), np.zeros(parameters)
    totals, samples, independent = np.zeros(3), 0.0, 0.0
    for body in range(view.lines.shape[0]):
        for edge in range(12):
            if view.faces[body, edge] >= 0:
                if view.creases[body, edge] > sampling.max_crease:
                    continue
                sums = EdgeSums(np.zeros((3, 3)), np.zeros(3), totals)
                added = _add_edge(view, image, settings, sampling, body, edge, sums)
                jacobian = view.line_jacobians[body, edge]
                add_normal_equations(hessian, gradient, jacobian, sums.moment, sums.force)
                if added.visible:
                    samples += added.samples
                    alone = added.samples * added.independent
                    independent += alone / (1.0 + settings.bias**2 * alone)
                    add_normal_equations(information, unused, jacobian, sums.moment, sums.force)
    return EdgeTerms(
        hessian, gradient, information, totals[0], totals[1], totals[2],
        independent / samples if samples > 0.0 else 1.0,
    )  # fmt: skip


@njit(cache=True, error_model="numpy")
def _add_edge(
    view: ModelView,
    image: InverseDepthImage,
    settings: EdgeSettings,
    sampling: EdgeSampling,
    body: int,
    edge: int,
    sums: EdgeSums,
) -> AddedEdge:
    """Add the samples of an edge, one in each row (or column)."""
    solids, lines, faces = view.solids, view.lines[body], view.faces[body]
    upwards, lowest = image.upwards, image.floor + settings.floor_margin
    noise, border = sampling.noise, sampling.border
    moment, force, totals = sums
    line, all_ends = lines[edge], view.ends[body]
    ends = all_ends[edge]
    along = 1 if abs(line[0]) >= abs(line[1]) else 0
    extent, width = image.inverse_depth.shape[1 - along], image.inverse_depth.shape[along]
    low, high = min(ends[along], ends[2 + along]), max(ends[along], ends[2 + along])
    first = max(0, math.ceil(low + border))
    last = min(extent - 1, math.floor(high - border))
    samples = max(last - first + 1, 1)
    min_noise = max(noise.lateral, 1.0 / samples)
    face = faces[edge] if view.creases[body, edge] > 0.0 else -1
    outwards = sampling.window / abs(line[1 - along])
    buffer = np.empty(2 * math.ceil(outwards) + 1)
    shifts = np.zeros(samples)
    sampled, with_step, independent = 0, 0, 1.0
    for number in range(first, last + 1, 1 + samples // sampling.max_samples):
        crossing = crossing_of(solids, body, faces[edge], line, number)
        u, v = pixel(crossing, crossing.position)
        inverse_depth = crossing.inverse_depth
        if (
            not image.farthest < inverse_depth < image.nearest
            or height_at(upwards, u, v, inverse_depth) < lowest
        ):
            continue
        inwards = min(outwards, half_chord(lines, all_ends, faces, edge, crossing))
        strip = strip_around(
            solids, image, settings, noise, body, face, crossing, (outwards, inwards), buffer
        )
        if strip.evidence.shape[0] == 0:
            continue
        sampled += 1
        if noise.lateral > 0.0:
            weight = _taper(number, low + border, high - border, border)
            add_probit(lines, faces, edge, crossing, strip, min_noise, weight, sums)
        informative, has_step, position = _nearest_step(crossing, strip, width, noise.lateral > 0.0)
        with_step += has_step
        if not informative:
            continue
        u, v = pixel(crossing, position)
        distance = line[0] * u + line[1] * v + line[2]
        shifts[number - first] = np.sign(distance) * max(abs(distance) - HALF_PIXEL, 0.0)
        if noise.lateral > 0.0:  # all samples together count like a single row
            weight = 1.0 / (1.0 / ROUNDING_INFORMATION + noise.lateral**2) / samples
        else:
            weight = SEARCH_DEVIATIONS**2 / sampling.window**2
            weight /= 1.0 + (2.0 * distance / sampling.window) ** 2
            weight *= 1.0 if has_step else settings.stepless_weight
        totals[0] += 0.5 * weight * distance**2
        add_pixel(moment, force, weight, weight * distance, u, v)
    if noise.lateral > 0.0:
        phases = settings.subpixel_phases * (last - first) * abs(line[along] / line[1 - along])
        weight = 1.0 / (1.0 + moment[2, 2] / (ROUNDING_INFORMATION * (1.0 + phases**2)))
        independent = _independent(shifts, settings.correlated_samples)
        weight *= independent
        weight /= 1.0 + sampling.shape_error**2 * weight * moment[2, 2]
        moment *= weight
        force *= weight
    return AddedEdge(with_step > settings.min_visible * sampled, sampled, independent)


@njit(cache=True, error_model="numpy")
def _nearest_step(
    crossing: Crossing, strip: Strip, width: int, fine: bool
) -> tuple[bool, bool, float]:
    """Find the depth step of a strip that is nearest to where the edge crosses it.

    Parameters
    ----------
    width
        Number of pixels of the whole row (or column).
    fine
        Only depth steps within the strip count, not those that lie beyond its ends.

    Returns
    -------
    informative, has_step, position
        Whether the strip says where the edge should be, whether a depth step lies within it, and
        the position of the nearest one, at or beyond its ends otherwise.
    """
    count = strip.evidence.shape[0]
    min_behind, max_behind = split(strip.evidence)
    behind = (crossing.position - strip.start) * strip.step + 0.5
    has_step = min_behind > 0 and max_behind < count
    clipped = strip.start == 0 or strip.start == width - 1
    informative = has_step or not (fine or (max_behind == 0 and clipped))
    if min_behind < behind < max_behind:
        informative = False
    behind = min(max(behind, min_behind), max_behind)
    return informative, has_step, strip.start + strip.step * (behind - 0.5)


@njit(cache=True, error_model="numpy")
def _independent(shifts: NDArray[np.float64], lags: int) -> float:
    """Return the fraction of an edge's samples that are independent of each other.

    The edges of real objects are not quite straight, and a sensor may shift a whole edge.
    """
    variance = (shifts**2).sum()
    return variance / newey_west_variance(shifts, lags) if variance > 0.0 else 1.0


@njit(cache=True, error_model="numpy")
def _taper(number: int, low: float, high: float, border: float) -> float:
    """Return a weight that rises from 0 at the ends of an edge, so that no sample jumps."""
    return min(1.0, (number - low) / border, (high - number) / border) if border > 0.0 else 1.0
