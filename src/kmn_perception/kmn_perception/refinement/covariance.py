"""What an observation leaves open: the covariance, and directions that the view cannot show."""

from __future__ import annotations

from collections.abc import Callable
from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kmn_perception.refinement.gauss_newton import Fit, fine_edges
from kmn_perception.refinement.problem import Problem

MIN_INFORMATION = 1e-12
MIN_COMPONENT = 1e-3  # of a direction, in half ranges; less does not run into a limit
DOUBLINGS, BISECTIONS = 4, 7  # in the search for a segment's ends
POINTS = 12  # of a segment
PASSES = 3  # through several open directions


class Segment(NamedTuple):
    """What is known along a direction: the median of how far to go, and the variance."""

    median: float
    variance: float


def with_covariance(problem: Problem, fit: Fit) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the values (P,) amid what the observation leaves open, and their covariance (P, P).

    In most directions the covariance is the inverse of the information. Along those that the view
    hardly shows, all values within the limits are equally likely beforehand, and the estimate is
    the median of what the edges leave of them.
    """
    half = problem.half_range
    information = (fit.depth_information + fit.edge_information) * np.outer(half, half)
    eigenvalues, directions = np.linalg.eigh(information)
    variances = 1.0 / np.maximum(eigenvalues, MIN_INFORMATION)
    is_open = variances > problem.settings.unobservable**2
    directions[:, is_open] = _disentangled(directions[:, is_open])
    for i, j in combinations(np.flatnonzero(is_open), 2):
        directions[:, [i, j]] = _more_open(problem, fit, directions[:, [i, j]])
    least = problem.settings.limit_softness**2
    values = fit.values
    for _ in range(PASSES if is_open.sum() > 1 else 1):
        for i in np.flatnonzero(is_open):
            direction = directions[:, i] * half
            segment = _segment(problem, fit, values, direction)
            values = values + segment.median * direction
            variances[i] = max(segment.variance, least)
    scaled = directions * half[:, None]
    return values, scaled * variances @ scaled.T


def _disentangled(basis: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return another basis (P, K) of the same directions, each with a parameter of its own.

    Each hidden end of an object is a direction, and any mixture of them is as open, but only along
    the ends themselves does one not touch the bounds of another (Gauss-Jordan elimination).
    """
    basis = basis.copy()
    own: list[int] = []
    for k in range(basis.shape[1]):
        free = np.abs(basis[:, k:])
        free[own] = 0.0
        parameter, column = divmod(int(np.argmax(free)), free.shape[1])
        basis[:, [k, k + column]] = basis[:, [k + column, k]]
        own.append(parameter)
        basis[:, k] /= basis[parameter, k]
        for other in range(basis.shape[1]):
            if other != k:
                basis[:, other] -= basis[parameter, other] * basis[:, k]
    return basis / np.linalg.norm(basis, axis=0)


def _more_open(problem: Problem, fit: Fit, pair: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a pair of open directions (P, 2), or their sum and difference if these lead farther.

    Where but one end of an object is hidden, neither its size nor its place alone is open, only
    both together. The pair is scaled so that both move the surface as far. Mostly the view shows at
    once that neither leads far enough to be open; the segments are long work.
    """
    half = problem.half_range[:, None]
    weights = problem.pixels_per_unit(fit.values)[:, None]
    alike = pair / np.linalg.norm(weights * half * pair, axis=0)
    turned = np.column_stack([alike[:, 0] + alike[:, 1], alike[:, 0] - alike[:, 1]])
    turned /= np.linalg.norm(turned, axis=0)
    if not any(_leads_far(problem, fit, direction) for direction in (half * turned).T):
        return pair
    variances = [
        max(
            _segment(problem, fit, fit.values, direction).variance for direction in (half * basis).T
        )
        for basis in (pair, turned)
    ]
    return turned if variances[1] > variances[0] else pair


def _leads_far(problem: Problem, fit: Fit, direction: NDArray[np.float64]) -> bool:
    """Return whether the segment along a direction may be so long that it is open."""
    loss = _loss_along(problem, fit, fit.values, direction)
    allowed = loss(0.0) + problem.settings.segment_rise
    low, high = _within_limits(problem, fit.values, direction)
    far = problem.settings.unobservable
    return any(low <= way <= high and loss(way) <= allowed for way in (-far, far))


def _segment(
    problem: Problem, fit: Fit, values: NDArray[np.float64], direction: NDArray[np.float64]
) -> Segment:
    """Integrate the likelihood along a direction, within the limits."""
    loss = _loss_along(problem, fit, values, direction)
    allowed = loss(0.0) + problem.settings.segment_rise
    low, high = (
        _last_allowed(loss, allowed, end) for end in _within_limits(problem, values, direction)
    )
    if high <= low:
        return Segment(0.0, 0.0)
    edges = np.linspace(low, high, POINTS + 1)
    ways = 0.5 * (edges[1:] + edges[:-1])
    losses = np.array([loss(way) for way in ways])
    weights = np.exp(losses.min() - losses)
    weights /= weights.sum()
    median = float(np.interp(0.5, np.append(0.0, np.cumsum(weights)), edges))
    cell = (high - low) / POINTS
    return Segment(median, float(weights @ (ways - median) ** 2 + cell**2 / 12.0))


def _loss_along(
    problem: Problem, fit: Fit, values: NDArray[np.float64], direction: NDArray[np.float64]
) -> Callable[[float], float]:
    """Return the negative log-likelihood as a function of the way along a direction.

    Pixels far from the edges that are explained wrongly count as well. The edges count up to their
    ends, so that the pixels that count do not change with them.
    """
    depth_information = float(direction @ fit.depth_information @ direction)
    pixels = min(len(problem.image.pixels), problem.settings.misfit.pixels)

    def loss(way: float) -> float:
        moved = values + way * direction
        edges = fine_edges(problem, problem.view(moved), fit.noise, 0.0).loss
        return edges + problem.misfit(moved) * pixels + 0.5 * depth_information * way**2

    return loss


def _last_allowed(loss: Callable[[float], float], allowed: float, end: float) -> float:
    """Return how far towards an end the loss stays allowed."""
    good, bad = 0.0, end
    for way in end * 0.5 ** np.arange(DOUBLINGS, -1.0, -1.0):
        if loss(way) > allowed:
            bad = way
            break
        good = way
    if good == end:
        return end
    for _ in range(BISECTIONS):
        middle = 0.5 * (good + bad)
        if loss(middle) <= allowed:
            good = middle
        else:
            bad = middle
    return good


def _within_limits(
    problem: Problem, values: NDArray[np.float64], direction: NDArray[np.float64]
) -> tuple[float, float]:
    """Return the least and greatest multiple of a direction that keeps the limits."""
    half = problem.half_range
    moved = np.abs(direction) > MIN_COMPONENT * half
    ways = (problem.limits[moved] - values[moved, None]) / direction[moved, None]
    return min(0.0, ways.min(axis=1).max()), max(0.0, ways.max(axis=1).min())
