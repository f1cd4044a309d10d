"""What an observation does not show: the covariance, and unobservable directions."""

from __future__ import annotations

from collections.abc import Callable
from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kmn_perception.refinement.gauss_newton import Fit, fine_edges
from kmn_perception.refinement.problem import Problem

MIN_INFORMATION = 1e-12
MIN_COMPONENT = 1e-3  # of a direction, in half ranges; smaller ones do not reach a limit
SQUARE_OUTLINE = 4.0  # length of a square's outline by the root of its area
DOUBLINGS, BISECTIONS = 4, 7  # in the search for the ends of the possible values


class Directions(NamedTuple):
    """Directions (P, P), as columns in half ranges, their variances, and the unobservable ones."""

    directions: NDArray[np.float64]
    variances: NDArray[np.float64]
    unobservable: NDArray[np.intp]


class Marginal(NamedTuple):
    """The distribution of the distance along a direction, in multiples of it."""

    median: float
    variance: float


def overlooked(problem: Problem, fit: Fit) -> list[NDArray[np.float64]]:
    """Return values (P,) from which to fit again: what the search has missed, if it has.

    Along an unobservable direction the fit has seen nothing. Where all that is possible there
    nevertheless lies close together, and away from the fit, it shows from there: the fit has left
    the image with an edge that is in it, say.
    """
    min_deviation = problem.settings.unobservable.deviation
    directions, _, unobservable = _directions(problem, fit)
    values, missed = fit.values, False
    for direction in (directions[:, unobservable] * problem.half_range[:, None]).T:
        marginal = _marginal(problem, fit, fit.values, direction)
        if abs(marginal.median) > min_deviation > np.sqrt(marginal.variance):
            values, missed = values + marginal.median * direction, True
    return [values] if missed else []


def with_covariance(problem: Problem, fit: Fit) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the values (P,) in the middle of what is possible, and their covariance (P, P).

    In observable directions the covariance is the inverse of the information. Along unobservable
    ones, all values within the limits are equally likely a priori; the estimate is the median, and
    the variance that of the posterior, given the likelihood of edges and depths.
    """
    settings, half_range = problem.settings.unobservable, problem.half_range
    directions, variances, unobservable = _directions(problem, fit)
    for i, j in combinations(unobservable, 2):
        directions[:, [i, j]] = _less_observable(problem, fit, directions[:, [i, j]])
    min_variance = problem.settings.limit_softness**2
    values = fit.values
    for _ in range(settings.passes if len(unobservable) > 1 else 1):
        for i in unobservable:
            direction = directions[:, i] * half_range
            marginal = _marginal(problem, fit, values, direction)
            values = values + marginal.median * direction
            variances[i] = max(marginal.variance, min_variance)
    scaled = directions * half_range[:, None]
    return values, scaled * variances @ scaled.T


def _directions(problem: Problem, fit: Fit) -> Directions:
    half_range = problem.half_range
    information = (fit.depth_information + fit.edge_information) * np.outer(half_range, half_range)
    eigenvalues, directions = np.linalg.eigh(information)
    variances = 1.0 / np.maximum(eigenvalues, MIN_INFORMATION)
    unobservable = np.flatnonzero(variances > problem.settings.unobservable.deviation**2)
    directions[:, unobservable] = _sparse(directions[:, unobservable])
    return Directions(directions, variances, unobservable)


def _sparse(basis: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a basis (P, K) of the same directions, each with a parameter that the others lack.

    Each hidden end of an object is an unobservable direction, and so is any mixture of them, but
    only along the ends themselves do the bounds of one not depend on another (Gauss-Jordan
    elimination).
    """
    basis = basis.copy()
    pivots: list[int] = []
    for k in range(basis.shape[1]):
        candidates = np.abs(basis[:, k:])
        candidates[pivots] = 0.0
        pivot, column = divmod(int(np.argmax(candidates)), candidates.shape[1])
        basis[:, [k, k + column]] = basis[:, [k + column, k]]
        pivots.append(pivot)
        basis[:, k] /= basis[pivot, k]
        for other in range(basis.shape[1]):
            if other != k:
                basis[:, other] -= basis[pivot, other] * basis[:, k]
    return basis / np.linalg.norm(basis, axis=0)


def _less_observable(problem: Problem, fit: Fit, pair: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a pair of directions (P, 2), or their sum and difference if one of these is longer.

    Where only one end of an object is hidden, neither its size nor its place alone is unobservable,
    only both together. The pair is scaled so that both move the surface equally far. Usually a look
    at the ends shows that neither sum nor difference is unobservable; integrating would be slow.
    """
    settings, half_range = problem.settings.unobservable, problem.half_range[:, None]
    pixels = problem.pixels_per_unit(fit.values)[:, None]
    equal = pair / np.linalg.norm(pixels * half_range * pair, axis=0)
    rotated = np.column_stack([equal[:, 0] + equal[:, 1], equal[:, 0] - equal[:, 1]])
    rotated /= np.linalg.norm(rotated, axis=0)
    if not any(_may_be_unobservable(problem, fit, axis) for axis in (half_range * rotated).T):
        return pair
    variances = [
        max(
            _marginal(problem, fit, fit.values, direction).variance
            for direction in (half_range * basis).T
        )
        for basis in (pair, rotated)
    ]
    return rotated if variances[1] > settings.longer**2 * variances[0] else pair


def _may_be_unobservable(problem: Problem, fit: Fit, direction: NDArray[np.float64]) -> bool:
    """Return whether the possible values along a direction may extend far enough."""
    loss = _loss_along(problem, fit, fit.values, direction)
    max_loss = loss(0.0) + problem.settings.unobservable.loss_rise
    low, high = _reach(problem, fit.values, direction)
    far = problem.settings.unobservable.deviation
    return any(low <= end <= high and loss(end) <= max_loss for end in (-far, far))


def _marginal(
    problem: Problem, fit: Fit, values: NDArray[np.float64], direction: NDArray[np.float64]
) -> Marginal:
    """Integrate the likelihood along a direction, within the limits."""
    settings = problem.settings.unobservable
    loss = _loss_along(problem, fit, values, direction)
    max_loss = loss(0.0) + settings.loss_rise
    low, high = (_last_possible(loss, max_loss, end) for end in _reach(problem, values, direction))
    if high <= low:
        return Marginal(0.0, 0.0)
    borders = np.linspace(low, high, settings.points + 1)
    distances = 0.5 * (borders[1:] + borders[:-1])
    losses = np.array([loss(distance) for distance in distances])
    weights = np.exp(losses.min() - losses)
    weights /= weights.sum()
    median = float(np.interp(0.5, np.append(0.0, np.cumsum(weights)), borders))
    cell = (high - low) / settings.points
    return Marginal(median, float(weights @ (distances - median) ** 2 + cell**2 / 12.0))


def _loss_along(
    problem: Problem, fit: Fit, values: NDArray[np.float64], direction: NDArray[np.float64]
) -> Callable[[float], float]:
    """Return the negative log-likelihood as a function of the distance along a direction.

    Pixels far from the edges that are explained wrongly count as well, if they are more than an
    error of the object's shape makes of its outline. The edges count up to their ends, so that the
    pixels that count do not change with them; what the fit's own edges tell by neighbours whose
    errors are the same counts once.
    """
    depth_information = float(direction @ fit.depth_information @ direction)
    count = len(problem.image.pixels)
    pixels = min(count, problem.settings.misfit.pixels)
    slack = problem.shape_error_in_pixels * SQUARE_OUTLINE / np.sqrt(count)
    allowed = problem.misfit(values) + slack

    def loss(distance: float) -> float:
        moved = values + distance * direction
        edges = fine_edges(problem, problem.view(moved), fit.noise, 0.0).loss
        wrong = max(problem.misfit(moved), allowed if slack > 0.0 else 0.0)
        return fit.independent * edges + wrong * pixels + 0.5 * depth_information * distance**2

    return loss


def _last_possible(loss: Callable[[float], float], max_loss: float, end: float) -> float:
    """Return how far towards an end the loss does not exceed its maximum."""
    possible, impossible = 0.0, end
    for distance in end * 0.5 ** np.arange(DOUBLINGS, -1.0, -1.0):
        if loss(distance) > max_loss:
            impossible = distance
            break
        possible = distance
    if possible == end:
        return end
    for _ in range(BISECTIONS):
        middle = 0.5 * (possible + impossible)
        if loss(middle) <= max_loss:
            possible = middle
        else:
            impossible = middle
    return possible


def _reach(
    problem: Problem, values: NDArray[np.float64], direction: NDArray[np.float64]
) -> tuple[float, float]:
    """Return the minimum and maximum multiple of a direction that stays within the limits."""
    moved = np.abs(direction) > MIN_COMPONENT * problem.half_range
    distances = (problem.limits[moved] - values[moved, None]) / direction[moved, None]
    return min(0.0, distances.min(axis=1).max()), max(0.0, distances.max(axis=1).min())
