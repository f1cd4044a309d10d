"""What an observation leaves open: the covariance, and directions that the view cannot show."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from kmn_perception.refinement.gauss_newton import Fit, Problem, fine_edges

LEAST_INFORMATION = 1e-12
LEAST_COMPONENT = 1e-3  # of a direction, in half ranges; less does not run into a limit
BISECTIONS = 12
PASSES = 2  # through several open directions


def with_covariance(problem: Problem, fit: Fit) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the values (P,) amid what the observation leaves open, and their covariance (P, P).

    In most directions the covariance is the inverse of the information. Along those that the view
    does not show, all values within the limits that do not contradict the observation are equally
    likely: the estimate is the middle of that segment, the variance its squared length / 12.
    """
    half = np.ptp(problem.limits, axis=1) / 2.0
    information = (fit.depth_information + fit.edge_information) * np.outer(half, half)
    eigenvalues, directions = np.linalg.eigh(information)
    variances = 1.0 / np.maximum(eigenvalues, LEAST_INFORMATION)
    is_open = variances > problem.settings.weak**2
    values = fit.values
    for _ in range(PASSES if is_open.sum() > 1 else 1):
        for i in np.flatnonzero(is_open):
            direction = directions[:, i] * half
            low, high = _segment(problem, fit, values, direction)
            values = values + 0.5 * (low + high) * direction
            variances[i] = max((high - low) ** 2 / 12.0, problem.settings.limit_softness**2)
    scaled = directions * half[:, None]
    return values, scaled * variances @ scaled.T


def _segment(
    problem: Problem, fit: Fit, values: NDArray[np.float64], direction: NDArray[np.float64]
) -> tuple[float, float]:
    """Return how far one can go back and forth along a direction before it is contradicted."""
    depth_information = direction @ fit.depth_information @ direction

    def loss(way: float) -> float:
        edges = fine_edges(problem, problem.view(values + way * direction), fit.noise)
        return edges.loss + 0.5 * depth_information * way**2

    allowed = loss(0.0) + problem.settings.segment_rise
    ends = []
    for end in _within_limits(problem, values, direction):
        good, bad = 0.0, end
        if loss(end) <= allowed:
            good = end
        else:
            for _ in range(BISECTIONS):
                middle = 0.5 * (good + bad)
                if loss(middle) <= allowed:
                    good = middle
                else:
                    bad = middle
        ends.append(good)
    return ends[0], ends[1]


def _within_limits(
    problem: Problem, values: NDArray[np.float64], direction: NDArray[np.float64]
) -> tuple[float, float]:
    """Return the least and greatest multiple of a direction that keeps the limits."""
    half = np.ptp(problem.limits, axis=1) / 2.0
    moved = np.abs(direction) > LEAST_COMPONENT * half
    ways = (problem.limits[moved] - values[moved, None]) / direction[moved, None]
    return min(0.0, ways.min(axis=1).max()), max(0.0, ways.max(axis=1).min())
