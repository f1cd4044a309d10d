"""Robust Gauss-Newton fit of a kinematic model to an image of inverse depth."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kmn_perception.refinement.edges import EdgeTerms, edge_terms
from kmn_perception.refinement.planes import PlaneTerms, plane_terms
from kmn_perception.refinement.problem import Problem
from kmn_perception.refinement.reacquisition import reacquire
from kmn_perception.refinement.settings import SearchSettings
from kmn_perception.refinement.view import ModelView

MEDIAN_TO_SIGMA = 1.4826  # of a normal distribution
COARSE = 3.0  # the coarse search ignores depths beyond this many standard deviations
ALL = 10**6  # samples of an edge
SWING = 6  # after as many steps they are halved, lest they swing to and fro
TENTH = 0.1  # pixels, and of the noise: what is less has settled


class Noise(NamedTuple):
    """Of the sensor: of the inverse depth (1 / m) and of the lateral position (pixels)."""

    depth: float
    lateral: float


class Fit(NamedTuple):
    """Values, noise, the information (P, P) that depths and edges hold about them, and steps."""

    values: NDArray[np.float64]
    noise: Noise
    depth_information: NDArray[np.float64]
    edge_information: NDArray[np.float64]
    steps: int


def fit(problem: Problem, values: NDArray[np.float64]) -> Fit:
    """Fit from a start: a coarse search that narrows, then down to the noise of the sensor."""
    search = problem.settings.search
    for level in search:
        values = _search(problem, values, level)
    caught = reacquire(
        problem.shape, problem.image, problem.limits, values, *problem.settings.reacquire
    )
    steps = sum(level.steps for level in search)
    if caught is not values:
        values = _search(problem, caught, search[-1])
        steps += search[-1].steps
    return _fit_finely(problem, values, steps)


def _search(
    problem: Problem, values: NDArray[np.float64], level: SearchSettings
) -> NDArray[np.float64]:
    """Take the steps of one level of the coarse search."""
    stride = problem.stride(problem.settings.depth_pixels)
    noise = level.depth / COARSE * problem.steepness
    for _ in range(level.steps):
        view = problem.view(values)
        planes = plane_terms(view, problem.image, stride, noise, 0.0, COARSE, 0.0)
        edges = edge_terms(
            view,
            problem.image,
            problem.settings.edges,
            level.window,
            0.0,
            noise / COARSE,
            0.0,
            level.samples,
        )
        values = problem.kept(values + _step(problem, values, planes, edges)[0])
    return values


def _fit_finely(problem: Problem, values: NDArray[np.float64], steps: int) -> Fit:
    """Fit to the noise of the sensor, which is estimated as well."""
    settings = problem.settings.fine
    least = Noise(settings.min_depth_noise * problem.steepness, settings.min_noise)
    depth = problem.settings.search[-1].depth / COARSE * problem.steepness
    noise = Noise(depth, settings.noise)
    for pixels in (problem.settings.depth_pixels, settings.depth_pixels):
        stride = problem.stride(pixels)
        for k in range(settings.steps):
            view = problem.view(values)
            planes = plane_terms(
                view, problem.image, stride, *noise, settings.robust, settings.border * noise[1]
            )
            edges = fine_edges(problem, view, noise, settings.border)
            step, moved = _step(problem, values, planes, edges)
            values = problem.kept(values + step / (1 + k // SWING))
            steps += 1
            before = noise
            noise = _estimate_noise(noise, least, planes, edges, settings.noise)
            change = np.abs(np.log(np.divide(noise, before))).max()
            if moved < settings.tolerance * max(noise.lateral, TENTH) and change < TENTH:
                break
        if noise.depth == least.depth:
            break  # exact depths: more of them tell nothing new
    return Fit(values, before, planes.hessian, edges.information, steps)


def _estimate_noise(
    noise: Noise, least: Noise, planes: PlaneTerms, edges: EdgeTerms, most: float
) -> Noise:
    """Return the noise that is likely, given what was found with the noise assumed."""
    depth = noise.depth
    if len(planes.residuals):
        depth *= MEDIAN_TO_SIGMA * float(np.median(np.abs(planes.residuals)))
    change = -edges.noise_gradient / max(edges.noise_information, 1.0)
    lateral = noise.lateral * float(np.exp(np.clip(change, -0.7, 0.7)))
    return Noise(max(depth, least.depth), min(max(lateral, least.lateral), most))


def fine_edges(problem: Problem, view: ModelView, noise: Noise, border: float) -> EdgeTerms:
    """Return the likelihood of the pixels beside the edges, but ``border`` s from their ends."""
    fine = problem.settings.fine
    window = max(fine.min_window, fine.window * noise.lateral)
    return edge_terms(
        view,
        problem.image,
        problem.settings.edges,
        window,
        noise.lateral,
        noise.depth,
        border * noise.lateral,
        ALL,
    )


def _step(
    problem: Problem,
    values: NDArray[np.float64],
    planes: PlaneTerms,
    edges: EdgeTerms,
) -> tuple[NDArray[np.float64], float]:
    """Return a damped step, and by how many pixels it moves the object."""
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
