"""Robust Gauss-Newton fit of a kinematic model to an image of inverse depth."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kmn_perception.refinement.edges import EdgeTerms, edge_terms
from kmn_perception.refinement.geometry import Shape, View, cuboids, view_of
from kmn_perception.refinement.image import Image
from kmn_perception.refinement.misfit import misfit
from kmn_perception.refinement.planes import PlaneTerms, plane_terms
from kmn_perception.refinement.settings import RefinementSettings

MEDIAN_TO_SIGMA = 1.4826  # of a normal distribution


class Problem(NamedTuple):
    """What is fitted to what."""

    shape: Shape
    limits: NDArray[np.float64]  # (P, 2)
    image: Image
    settings: RefinementSettings

    def view(self, values: NDArray[np.float64]) -> View:
        """Return the model as the sensor sees it."""
        return view_of(self.shape, values, self.image.projection)

    def misfit(self, values: NDArray[np.float64]) -> float:
        """Return the share of pixels that the model at ``values`` explains wrongly."""
        settings = self.settings.misfit
        return misfit(self.view(values), self.image, settings.pixels, settings.depth)

    @property
    def stride(self) -> int:
        """Of the pixels whose depth is compared in one step."""
        return max(1, len(self.image.pixels) // self.settings.depth_pixels)

    @property
    def steepness(self) -> float:
        """Inverse depth per metre at the object's distance, 1 / m^2."""
        return float(np.mean(self.image.pixels[:: self.stride, 2])) ** 2


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
    steps = 0
    for level in problem.settings.search:
        deviation = level.depth / 3.0 * problem.steepness
        for _ in range(level.steps):
            view = problem.view(values)
            planes = plane_terms(view, problem.image.pixels, problem.stride, 3.0 * deviation)
            edges = edge_terms(view, problem.image, problem.settings.edges, level.window, 0.0)
            values, _ = _step(problem, values, planes, edges, deviation)
            steps += 1
    return _fit_finely(problem, values, steps)


def _fit_finely(problem: Problem, values: NDArray[np.float64], steps: int) -> Fit:
    settings = problem.settings.fine
    lateral = settings.noise
    least = settings.least_depth_noise * problem.steepness
    depth = problem.settings.search[-1].depth / 3.0 * problem.steepness
    stride = problem.stride
    for _ in range(settings.steps):
        view = problem.view(values)
        planes = plane_terms(view, problem.image.pixels, stride, settings.robust * depth)
        if len(planes.residuals):
            depth = max(least, MEDIAN_TO_SIGMA * float(np.median(np.abs(planes.residuals))))
        edges = fine_edges(problem, view, lateral)
        depth_information = stride * planes.hessian / depth**2
        values, moved = _step(problem, values, planes, edges, depth / np.sqrt(stride))
        steps += 1
        change = -edges.noise_gradient / max(edges.noise_information, 1.0)
        sharper = lateral * float(np.exp(np.clip(change, -0.7, 0.7)))
        settled = abs(np.log(max(sharper, settings.least_noise) / lateral)) < 0.02
        lateral = min(max(sharper, settings.least_noise), settings.noise)
        if moved < settings.tolerance and settled:
            if stride == 1 or depth == least:
                break
            stride = 1
    return Fit(values, Noise(depth, lateral), depth_information, edges.hessian, steps)


def fine_edges(problem: Problem, view: View, lateral: float) -> EdgeTerms:
    """Return the likelihood of the pixels beside the edges at a lateral noise in pixels."""
    fine = problem.settings.fine
    window = max(fine.least_window, fine.window * lateral)
    return edge_terms(view, problem.image, problem.settings.edges, window, lateral)


def _step(
    problem: Problem,
    values: NDArray[np.float64],
    planes: PlaneTerms,
    edges: EdgeTerms,
    depth_noise: float,
) -> tuple[NDArray[np.float64], float]:
    """Take a damped step; also return by how many pixels it moves the object."""
    hessian = planes.hessian / depth_noise**2 + edges.hessian
    gradient = planes.gradient / depth_noise**2 + edges.gradient
    centre, half = problem.limits.mean(axis=1), np.ptp(problem.limits, axis=1) / 2.0
    softness = problem.settings.limit_softness * half
    beyond = values - np.clip(values, centre - half, centre + half)
    hessian = hessian + np.diag((beyond != 0.0) / softness**2)
    gradient = gradient + beyond / softness**2
    pixels = pixels_per_unit(problem, values)
    damped = hessian + problem.settings.damping * np.diag(pixels**2)
    scale = 1.0 / np.sqrt(np.diag(damped))
    step = -scale * np.linalg.solve(damped * np.outer(scale, scale), scale * gradient)
    return values + step, float(np.abs(step * pixels).max())


def pixels_per_unit(problem: Problem, values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return by about how many pixels each parameter (P,) moves the object's surface."""
    _, slopes = cuboids(problem.shape, values)
    corners = 0.25 * (slopes[:, :, :3] ** 2).sum(axis=(1, 2)) + (slopes[:, :, 3] ** 2).sum(axis=1)
    focal_length = np.linalg.norm(problem.image.projection[0, :3])
    return np.sqrt(corners.max(axis=0) * problem.steepness) * focal_length + 1e-12
