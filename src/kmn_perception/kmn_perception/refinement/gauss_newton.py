"""Robust Gauss-Newton fit of a kinematic model to an image of inverse depth."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kmn_perception.refinement.edges import (
    SEARCH_DEVIATIONS,
    EdgeSampling,
    EdgeTerms,
    edge_terms,
)
from kmn_perception.refinement.image import MEDIAN_TO_SIGMA, Noise
from kmn_perception.refinement.planes import PlaneSampling, PlaneTerms, plane_terms
from kmn_perception.refinement.problem import Problem
from kmn_perception.refinement.reacquisition import reacquire
from kmn_perception.refinement.settings import SearchSettings
from kmn_perception.refinement.view import ModelView

MAX_NOISE_CHANGE = 0.7  # of the logarithm of the lateral noise in a step
UNLIMITED = 10**6  # samples of an edge


class Fit(NamedTuple):
    """A fit of a model with P parameters.

    Attributes
    ----------
    values
        (P,) of the parameters.
    noise
        Of the sensor, as estimated.
    depth_information, edge_information
        (P, P) what the depths and the edges tell about the values.
    steps
        Number of Gauss-Newton steps.
    independent
        Fraction of the edges' samples that are independent of each other.
    """

    values: NDArray[np.float64]
    noise: Noise
    depth_information: NDArray[np.float64]
    edge_information: NDArray[np.float64]
    steps: int
    independent: float


def fit(problem: Problem, values: NDArray[np.float64]) -> Fit:
    """Fit from a start: a coarse search that narrows, then down to the noise of the sensor."""
    settings, values = problem.settings, search(problem, values)
    steps = sum(level.steps for level in settings.search)
    reacquired = reacquire(problem, values)
    if reacquired is not values:
        values = _search(problem, reacquired, settings.search[-1])
        steps += settings.search[-1].steps
    return _fit_finely(problem, values, steps)


def search(problem: Problem, values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Search from a start (P,), wide at first and then closer and closer."""
    for level in problem.settings.search:
        values = _search(problem, values, level)
    return values


def _search(
    problem: Problem, values: NDArray[np.float64], level: SearchSettings
) -> NDArray[np.float64]:
    """Take the steps of one level of the coarse search."""
    settings = problem.settings
    noise = level.depth / SEARCH_DEVIATIONS * problem.inverse_depth_per_metre
    plane_sampling = PlaneSampling(
        noise=Noise(noise, 0.0),
        stride=problem.stride(settings.depth_pixels),
        robust=SEARCH_DEVIATIONS,
        border=0.0,
        correlated_rows=settings.correlated_rows,
        shape_error=0.0,
    )
    edge_sampling = EdgeSampling(
        noise=Noise(noise / SEARCH_DEVIATIONS, 0.0),
        window=level.window,
        border=0.0,
        max_samples=level.samples,
        max_crease=level.window,
        shape_error=0.0,
    )
    steps = settings.edges._replace(contrast=problem.visible_step)
    for _ in range(level.steps):
        view = problem.view(values)
        planes = plane_terms(view, problem.image, plane_sampling)
        edges = edge_terms(view, problem.image, steps, edge_sampling)
        values = problem.clipped(values + _step(problem, values, planes, edges)[0])
    return values


def _fit_finely(problem: Problem, values: NDArray[np.float64], steps: int) -> Fit:
    """Fit down to the noise of the sensor, which is estimated as well."""
    settings = problem.settings.fine
    per_metre = problem.inverse_depth_per_metre
    min_noise = Noise(settings.min_depth_noise * per_metre, settings.min_noise)
    noise = Noise(problem.settings.search[-1].depth / SEARCH_DEVIATIONS * per_metre, settings.noise)
    for pixels in (problem.settings.depth_pixels, settings.depth_pixels):
        for k in range(settings.steps):
            view = problem.view(values)
            planes = _fine_planes(problem, view, noise, pixels)
            edges = fine_edges(problem, view, noise, settings.border)
            step, movement = _step(problem, values, planes, edges)
            values = problem.clipped(values + step / (1 + k // settings.shorten_after))
            steps += 1
            before = noise
            noise = _estimate_noise(noise, min_noise, planes, edges, settings.noise)
            change = np.abs(np.log(np.divide(noise, before))).max()
            tolerance = settings.tolerance * max(noise.lateral, settings.min_tolerance_noise)
            if movement < tolerance and change < settings.noise_tolerance:
                break
        if noise.depth == min_noise.depth:
            break  # exact depths: more of them tell nothing new
    return Fit(values, before, planes.hessian, edges.information, steps, edges.independent)


def _fine_planes(problem: Problem, view: ModelView, noise: Noise, pixels: int) -> PlaneTerms:
    """Compare about this many of the observed pixels with the faces."""
    settings = problem.settings
    sampling = PlaneSampling(
        noise=noise,
        stride=problem.stride(pixels),
        robust=settings.fine.robust,
        border=settings.fine.border * noise.lateral,
        correlated_rows=settings.correlated_rows,
        shape_error=problem.shape_error * problem.inverse_depth_per_metre,
    )
    return plane_terms(view, problem.image, sampling)


def fine_edges(problem: Problem, view: ModelView, noise: Noise, border: float) -> EdgeTerms:
    """Return the likelihood of the pixels beside the edges.

    Parameters
    ----------
    border
        Pixels closer than this to the ends of the edges are left out, in units of the lateral
        noise.
    """
    settings = problem.settings.fine
    sampling = EdgeSampling(
        noise=noise,
        window=max(settings.min_window, settings.window * noise.lateral),
        border=border * noise.lateral,
        max_samples=UNLIMITED,
        max_crease=settings.border * noise.lateral,
        shape_error=problem.shape_error_in_pixels,
    )
    return edge_terms(view, problem.image, problem.settings.edges, sampling)


def _estimate_noise(
    noise: Noise, min_noise: Noise, planes: PlaneTerms, edges: EdgeTerms, max_lateral: float
) -> Noise:
    """Return the most likely noise, given the residuals under the noise that was assumed."""
    depth = noise.depth
    if len(planes.residuals):
        depth *= MEDIAN_TO_SIGMA * float(np.median(np.abs(planes.residuals)))
    change = -edges.noise_gradient / max(edges.noise_information, 1.0)
    lateral = noise.lateral * float(np.exp(np.clip(change, -MAX_NOISE_CHANGE, MAX_NOISE_CHANGE)))
    return Noise(max(depth, min_noise.depth), min(max(lateral, min_noise.lateral), max_lateral))


def _step(
    problem: Problem,
    values: NDArray[np.float64],
    planes: PlaneTerms,
    edges: EdgeTerms,
) -> tuple[NDArray[np.float64], float]:
    """Return a damped step (P,), and how far it moves the object's surface, pixels."""
    hessian = planes.hessian + edges.hessian
    gradient = planes.gradient + edges.gradient
    low, high = problem.limits.T
    softness = problem.settings.limit_softness * problem.half_range
    beyond = values - np.minimum(np.maximum(values, low), high)
    pixels = problem.pixels_per_unit(values)
    damping = (beyond != 0.0) / softness**2 + problem.settings.damping * pixels**2
    damped = hessian + np.diag(damping)
    gradient += beyond / softness**2
    scale = 1.0 / np.sqrt(np.diag(damped))
    step = -scale * np.linalg.solve(damped * np.outer(scale, scale), scale * gradient)
    return step, float(np.abs(step * pixels).max())
