"""The best fit of a model to an observation, from the network's estimate or without it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.model.observation import Observation
from kmn_perception.refinement.covariance import overlooked, with_covariance
from kmn_perception.refinement.curvature import curved_face
from kmn_perception.refinement.gauss_newton import Fit, fit, search
from kmn_perception.refinement.problem import Problem
from kmn_perception.refinement.settings import RefinementSettings
from kmn_perception.refinement.starts import (
    above_centroid,
    around,
    scanned,
    with_joints_moved,
    yawed,
)
from kmn_perception.refinement.states import JointEvidence
from kmn_perception.refinement.support import unsupported


class Refinement(NamedTuple):
    """A fit of the model to an observation.

    Attributes
    ----------
    values, covariance
        (P,) and (P, P) of (theta, gamma) and the positions of the model's ``states``.
    misfit
        Fraction of the observed pixels that the model explains wrongly.
    iterations
        Number of Gauss-Newton steps.
    improved
        Whether the misfit is not larger than that of the start. Otherwise the start is returned.
        Its covariance is that of the fit plus their difference where the two agree, and that of the
        limits where they do not.
    reason
        Why the result is not to be trusted; empty if it is.
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
    shape_error: float = 0.0,
) -> Refinement:
    """Fit (theta, gamma) to an observation, starting from ``values`` (n + m,).

    The result is never worse than the start by the common misfit. Joints whose positions are
    estimated are at 0 unless the observation says otherwise.

    Parameters
    ----------
    shape_error
        Standard deviation by which faces and edges of the object lie off those of a cuboid, metres.
    """
    problem = Problem.of(model, observation, settings, shape_error)
    values = np.asarray(values, dtype=np.float64)
    if few := _too_few(problem):
        return _unrefined(problem.freed(model), values, np.nan, 0, few)
    if not np.isfinite(values).all():
        return _unrefined(problem.freed(model), values, np.nan, 0, "the start is not finite")
    return _refined(model, problem, observation.points, values, [values])


def fit_once(
    model: KinematicModel,
    observation: Observation,
    values: NDArray[np.float64],
    settings: RefinementSettings,
) -> NDArray[np.float64]:
    """Return the fit from one start (n + m,), neither judged nor with a covariance.

    It is of (theta, gamma) and the positions of the joints that are free, if there are any.
    """
    problem = Problem.of(model, observation, settings)
    if len(problem.image.pixels) < settings.min_points:
        return values
    values = fit(problem, values).values
    if not model.states:
        return values
    return fit(problem.freed(model), np.append(values, np.zeros(len(model.states)))).values


def refine_from_scratch(
    model: KinematicModel, observation: Observation, settings: RefinementSettings
) -> Refinement:
    """Fit (theta, gamma) to an observation without an estimate, from several starts."""
    problem = Problem.of(model, observation, settings)
    start = above_centroid(model, observation)
    if few := _too_few(problem):
        return _unrefined(problem.freed(model), start, np.nan, 0, few)
    starts = yawed(model, start, settings.starts.yaws)
    starts.sort(key=problem.misfit)
    best = starts[: settings.starts.fitted]
    return _refined(model, problem, observation.points, starts[0], best)


def _too_few(problem: Problem) -> str:
    """Return how many points there are if those are too few; else empty."""
    count, least = len(problem.image.pixels), problem.settings.min_points
    return f"{count} points in the image, at least {least} are needed" if count < least else ""


def _refined(
    model: KinematicModel,
    problem: Problem,
    points: NDArray[np.float32],
    start: NDArray[np.float64],
    starts: list[NDArray[np.float64]],
) -> Refinement:
    """Fit with the joints at 0, and with free ones to tell whether they are."""
    at_rest = _best(model, problem, points, start, [fit(problem, values) for values in starts])
    if not model.states:
        return at_rest
    settings, freed = problem.settings, problem.freed(model)
    closed = np.concatenate([at_rest.values, np.zeros(len(model.states))])
    if at_rest.misfit > settings.states.hopeless:
        return at_rest._replace(values=closed, covariance=_uniform_covariance(freed))
    loose = fit(freed, closed)
    evidence = JointEvidence.of(freed, loose, len(model.states))
    plausible = not at_rest.reason and problem.explains(at_rest.misfit)
    if plausible and evidence.excess <= settings.states.sure:
        return at_rest._replace(values=closed, covariance=evidence.at_rest(at_rest.covariance))
    free = _best(model, freed, points, closed, [loose])
    if not free.reason and problem.explains(free.misfit):
        return free
    moved = [at for values in (at_rest.values, start) for at in with_joints_moved(freed, values)]
    moved.sort(key=freed.misfit)
    likely = moved[: 2 * settings.starts.fitted]
    found = sorted((search(freed, values) for values in likely), key=freed.misfit)
    fits = [loose, *(fit(freed, values) for values in found[: settings.starts.fitted])]
    return _best(model, freed, points, closed, fits)


def _best(
    model: KinematicModel,
    problem: Problem,
    points: NDArray[np.float32],
    start: NDArray[np.float64],
    from_starts: list[Fit],
) -> Refinement:
    """Return the best of all fits, and of those from what a scan finds where they fail."""
    settings = problem.settings.misfit
    fits = [(candidate, problem.misfit(candidate.values)) for candidate in from_starts]
    best, misfit = min(fits, key=_misfit)
    if misfit > settings.retry_above:
        fits += [_fit_with_misfit(problem, scanned(problem, v)) for v in (best.values, start)]
        best, misfit = min(fits, key=_misfit)
    if misfit > settings.boxes_above:
        boxes = around(model, points, problem.settings.starts)
        fits += [_fit_with_misfit(problem, values) for values in boxes]
        best, misfit = min(fits, key=_misfit)
    if settings.as_good < misfit <= settings.reject_above:
        fits += [_fit_with_misfit(problem, values) for values in overlooked(problem, best)]
        best, misfit = min(fits, key=_misfit)
    iterations = sum(candidate.steps for candidate, _ in fits)
    rejected = misfit > settings.reject_above
    if rejected:
        values, covariance = best.values, _uniform_covariance(problem)
    else:
        values, covariance = with_covariance(problem, best)
        covariance = covariance + _rivalry(model, best.values, fits, misfit + settings.as_good)
    names = [body.name for body in model.bodies]
    doubt = unsupported(problem, values, best.noise, names)
    doubt = doubt or curved_face(problem, values)
    misfit, before = problem.final_misfit(values), problem.final_misfit(start)
    improved = misfit <= before
    if not improved:
        error = start - values
        spread = covariance + np.diag(problem.pixels_per_unit(values) ** -2.0)
        if error @ np.linalg.solve(spread, error) > problem.settings.agreement**2 * len(error):
            less = f"the fit explains less ({misfit:.3f} wrong) than its start ({before:.3f})"
            return _unrefined(problem, start, before, iterations, doubt or less)
        values, covariance, misfit = start, covariance + np.outer(error, error), before
    if rejected or misfit > settings.reject_above:
        doubt = f"the model explains {max(misfit, settings.reject_above):.0%} or more wrongly"
    doubt = doubt or _unknown(model, problem, covariance)
    return Refinement(values, covariance, misfit, iterations, improved, doubt)


def _fit_with_misfit(problem: Problem, values: NDArray[np.float64]) -> tuple[Fit, float]:
    candidate = fit(problem, values)
    return candidate, problem.misfit(candidate.values)


def _misfit(candidate: tuple[Fit, float]) -> float:
    return candidate[1]


def _rivalry(
    model: KinematicModel,
    values: NDArray[np.float64],
    fits: Sequence[tuple[Fit, float]],
    max_misfit: float,
) -> NDArray[np.float64]:
    """Return the covariance (P, P) by fits that explain as much, and may as well be right."""
    rivals = [
        model.nearest_equivalent(rival.values, values) - values
        for rival, misfit in fits
        if misfit <= max_misfit
    ]
    return np.asarray(np.transpose(rivals) @ np.array(rivals) / len(rivals))


def _unknown(model: KinematicModel, problem: Problem, covariance: NDArray[np.float64]) -> str:
    """Return which parameters of the transformation are not known at all; empty if none."""
    known, unknown = _uniform_covariance(problem), problem.settings.unobservable.unknown
    shares = np.sqrt(np.diag(covariance) / np.diag(known))
    names = [p.name for p, share in zip(model.theta, shares, strict=False) if share > unknown]
    return f"hardly anything is known of {', '.join(names)}" if names else ""


def _unrefined(
    problem: Problem, values: NDArray[np.float64], misfit: float, iterations: int, reason: str
) -> Refinement:
    """Return the start (P,), or (n + m,) of it, with all joints at 0."""
    start = np.zeros(len(problem.limits))
    start[: len(values)] = values
    return Refinement(start, _uniform_covariance(problem), misfit, iterations, False, reason)


def _uniform_covariance(problem: Problem) -> NDArray[np.float64]:
    """Return the covariance (P, P) of values that are known to lie within the limits only."""
    return np.diag(np.ptp(problem.limits, axis=1) ** 2 / 12.0)
