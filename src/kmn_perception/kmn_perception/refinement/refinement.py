"""The best fit of a model to an observation, from the network's estimate or without it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.model.observation import Observation
from kmn_perception.refinement.covariance import with_covariance
from kmn_perception.refinement.gauss_newton import Fit, fit
from kmn_perception.refinement.problem import Problem
from kmn_perception.refinement.settings import RefinementSettings

SCAN = 9  # values of each parameter that are tried, within its limits
YAWS = 9
AT_THE_FIT = 3.0  # pixels or standard deviations within which a start is as good as the fit


class Refinement(NamedTuple):
    """A fit of the model to an observation.

    Attributes
    ----------
    values, covariance
        (n + m,) and (n + m, n + m) of (theta, gamma).
    misfit
        Share of the observed pixels that the model explains wrongly.
    iterations
        Steps that were taken.
    improved
        The misfit is not larger than that of the start. Else the start is returned; its covariance
        is that of the fit and their difference where the two agree, and that of the limits where
        they do not.
    reason
        Why the result is not to be trusted; empty when it is fine.
    """

    values: NDArray[np.float64]
    covariance: NDArray[np.float64]
    misfit: float
    iterations: int
    improved: bool
    reason: str


def refine(
    model: KinematicModel,
    observation: Observation,
    values: NDArray[np.float64],
    settings: RefinementSettings,
) -> Refinement:
    """Fit (theta, gamma) to an observation, starting from ``values`` (n + m,).

    The result is never worse than the start by the common misfit.
    """
    problem = Problem.of(model, observation, settings)
    values = np.asarray(values, dtype=np.float64)
    count = len(problem.image.pixels)
    if count < settings.min_points:
        reason = f"{count} points in the image, at least {settings.min_points} are needed"
        return _unrefined(model, values, np.nan, 0, reason)
    if not np.isfinite(values).all():
        return _unrefined(model, values, np.nan, 0, "the start is not finite")
    return _refined(model, problem, values, [values])


def refine_from_scratch(
    model: KinematicModel, observation: Observation, settings: RefinementSettings
) -> Refinement:
    """Fit (theta, gamma) to an observation without any estimate: from several starts."""
    problem = Problem.of(model, observation, settings)
    start = _above_centroid(model, observation)
    count = len(problem.image.pixels)
    if count < settings.min_points:
        reason = f"{count} points in the image, at least {settings.min_points} are needed"
        return _unrefined(model, start, np.nan, 0, reason)
    starts = _turned(model, start)
    starts.sort(key=problem.misfit)
    return _refined(model, problem, starts[0], starts[: settings.starts])


def _refined(
    model: KinematicModel,
    problem: Problem,
    start: NDArray[np.float64],
    starts: list[NDArray[np.float64]],
) -> Refinement:
    """Fit from all starts, and from what a scan finds where they fail; keep the best."""
    settings = problem.settings.misfit
    fits = [_fit_with_misfit(problem, values) for values in starts]
    iterations = sum(candidate.steps for candidate, _ in fits)
    best, misfit = min(fits, key=lambda pair: pair[1])
    if misfit > settings.bad:
        for values in (best.values, start):
            candidate, candidate_misfit = _fit_with_misfit(problem, _scan(problem, values))
            iterations += candidate.steps
            if candidate_misfit < misfit:
                best, misfit = candidate, candidate_misfit
    if misfit > settings.wrong:
        values, covariance = best.values, _within_limits(model)
    else:
        values, covariance = with_covariance(problem, best)
    misfit, before = problem.final_misfit(values), problem.final_misfit(start)
    improved = misfit <= before
    if not improved:
        error = start - values
        spread = covariance + np.diag(problem.pixels_per_unit(values) ** -2.0)
        if error @ np.linalg.solve(spread, error) > AT_THE_FIT**2 * len(error):
            reason = f"the fit explains less ({misfit:.3f} wrong) than its start ({before:.3f})"
            return _unrefined(model, start, before, iterations, reason)
        values, covariance, misfit = start, covariance + np.outer(error, error), before
    reason = ""
    if misfit > settings.wrong:
        reason = f"the model explains {misfit:.0%} of the observation wrongly"
    return Refinement(values, covariance, misfit, iterations, improved, reason)


def _fit_with_misfit(problem: Problem, values: NDArray[np.float64]) -> tuple[Fit, float]:
    candidate = fit(problem, values)
    return candidate, problem.misfit(candidate.values)


def _unrefined(
    model: KinematicModel, values: NDArray[np.float64], misfit: float, iterations: int, reason: str
) -> Refinement:
    """Return the start."""
    return Refinement(values, _within_limits(model), misfit, iterations, False, reason)


def _within_limits(model: KinematicModel) -> NDArray[np.float64]:
    """Return the covariance (P, P) of values of which no more is known than the limits."""
    return np.diag(np.ptp(model.limits, axis=1) ** 2 / 12.0)


def _scan(problem: Problem, values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Improve the parameters one after another, each by trying values all over its range."""
    best, least = values, problem.misfit(values)
    for i, (low, high) in enumerate(problem.limits):
        for value in np.linspace(low, high, SCAN):
            candidate = best.copy()
            candidate[i] = value
            misfit = problem.misfit(candidate)
            if misfit < least:
                best, least = candidate, misfit
    return best


def _above_centroid(model: KinematicModel, observation: Observation) -> NDArray[np.float64]:
    """Return the prototype, moved horizontally to the points."""
    values = np.zeros(len(model.parameters))
    if len(observation.points):
        centroid = observation.points.mean(axis=0)
        for axis, name in enumerate("xy"):
            if ("translation", name) in model.transformation.kinds:
                values[model.transformation.kinds.index(("translation", name))] = centroid[axis]
    return np.clip(values, *model.limits.T)


def _turned(model: KinematicModel, values: NDArray[np.float64]) -> list[NDArray[np.float64]]:
    """Return the values with yaws all over their range."""
    if ("rotation", "z") not in model.transformation.kinds:
        return [values]
    yaw = model.transformation.kinds.index(("rotation", "z"))
    starts = np.repeat(values[None], YAWS, axis=0)
    starts[:, yaw] = np.linspace(model.limits[yaw, 0], model.limits[yaw, 1], YAWS)
    return list(starts)
