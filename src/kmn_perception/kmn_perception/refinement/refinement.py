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
from kmn_perception.refinement.gauss_newton import Fit, fit
from kmn_perception.refinement.problem import Problem
from kmn_perception.refinement.settings import RefinementSettings, StartSettings
from kmn_perception.refinement.support import unsupported


class Refinement(NamedTuple):
    """A fit of the model to an observation.

    Attributes
    ----------
    values, covariance
        (n + m,) and (n + m, n + m) of (theta, gamma).
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

    The result is never worse than the start by the common misfit.

    Parameters
    ----------
    shape_error
        Standard deviation by which faces and edges of the object lie off those of a cuboid, metres.
    """
    problem = Problem.of(model, observation, settings, shape_error)
    values = np.asarray(values, dtype=np.float64)
    count = len(problem.image.pixels)
    if count < settings.min_points:
        reason = f"{count} points in the image, at least {settings.min_points} are needed"
        return _unrefined(model, values, np.nan, 0, reason)
    if not np.isfinite(values).all():
        return _unrefined(model, values, np.nan, 0, "the start is not finite")
    return _refined(model, problem, observation.points, values, [values])


def fit_once(
    model: KinematicModel,
    observation: Observation,
    values: NDArray[np.float64],
    settings: RefinementSettings,
) -> NDArray[np.float64]:
    """Return the fit (P,) from one start (P,), neither judged nor with a covariance."""
    problem = Problem.of(model, observation, settings)
    return (
        values if len(problem.image.pixels) < settings.min_points else fit(problem, values).values
    )


def refine_from_scratch(
    model: KinematicModel, observation: Observation, settings: RefinementSettings
) -> Refinement:
    """Fit (theta, gamma) to an observation without an estimate, from several starts."""
    problem = Problem.of(model, observation, settings)
    start = _above_centroid(model, observation)
    count = len(problem.image.pixels)
    if count < settings.min_points:
        reason = f"{count} points in the image, at least {settings.min_points} are needed"
        return _unrefined(model, start, np.nan, 0, reason)
    starts = _yawed(model, start, settings.starts.yaws)
    starts.sort(key=problem.misfit)
    best = starts[: settings.starts.fitted]
    return _refined(model, problem, observation.points, starts[0], best)


def _refined(
    model: KinematicModel,
    problem: Problem,
    points: NDArray[np.float32],
    start: NDArray[np.float64],
    starts: list[NDArray[np.float64]],
) -> Refinement:
    """Fit from all starts, and from what a scan finds where they fail; return the best."""
    settings = problem.settings.misfit
    fits = [_fit_with_misfit(problem, values) for values in starts]
    best, misfit = min(fits, key=_misfit)
    if misfit > settings.retry_above:
        fits += [_fit_with_misfit(problem, _scan(problem, v)) for v in (best.values, start)]
        best, misfit = min(fits, key=_misfit)
    if misfit > settings.boxes_above:
        boxes = _around(model, points, problem.settings.starts)
        fits += [_fit_with_misfit(problem, values) for values in boxes]
        best, misfit = min(fits, key=_misfit)
    if settings.as_good < misfit <= settings.reject_above:
        fits += [_fit_with_misfit(problem, values) for values in overlooked(problem, best)]
        best, misfit = min(fits, key=_misfit)
    iterations = sum(candidate.steps for candidate, _ in fits)
    rejected = misfit > settings.reject_above
    if rejected:
        values, covariance = best.values, _uniform_covariance(model)
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
            return _unrefined(model, start, before, iterations, doubt or less)
        values, covariance, misfit = start, covariance + np.outer(error, error), before
    if rejected or misfit > settings.reject_above:
        doubt = f"the model explains {max(misfit, settings.reject_above):.0%} or more wrongly"
    doubt = doubt or _unknown(model, covariance, problem.settings.unobservable.unknown)
    return Refinement(values, covariance, misfit, iterations, improved, doubt)


def _fit_with_misfit(problem: Problem, values: NDArray[np.float64]) -> tuple[Fit, float]:
    candidate = fit(problem, values)
    return candidate, problem.misfit(candidate.values)


def _misfit(candidate: tuple[Fit, float]) -> float:
    return candidate[1]


def _around(
    model: KinematicModel, points: NDArray[np.float32], settings: StartSettings
) -> list[NDArray[np.float64]]:
    """Return cuboids of several yaws around the points (N, 3); none of a model that is no cuboid.

    Of a carton that is half hidden, or shows one face only, a wrong yaw may be a minimum.
    """
    kinds = model.transformation.kinds
    if model.symmetry != "quarter_turn" or len(model.bodies) > 1:
        return []
    names = [("translation", "x"), ("translation", "y"), ("rotation", "z")]
    places = [kinds.index(kind) for kind in names]
    size, starts = np.diag(model.prototype_cubes[0]), []
    low, high = model.limits[places[2]]
    for k in range(settings.around):
        yaw = low + (k + 0.5) / settings.around * (high - low)
        axes = np.array([[np.cos(yaw), np.sin(yaw)], [-np.sin(yaw), np.cos(yaw)]])
        ends = np.quantile(points[:, :2] @ axes.T, [settings.rest, 1.0 - settings.rest], axis=0)
        extent = [*(ends[1] - ends[0]), np.quantile(points[:, 2], 1.0 - settings.rest)]
        values = model.prototype.copy()
        values[places] = [*(ends.mean(axis=0) @ axes), yaw]
        for axis, name in enumerate("xyz"):
            if ("scale", name) in kinds:
                values[kinds.index(("scale", name))] = extent[axis] / size[axis] - 1.0
        starts.append(np.clip(values, *model.limits.T))
    return starts


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


def _unknown(model: KinematicModel, covariance: NDArray[np.float64], unknown: float) -> str:
    """Return which parameters of the transformation are not known at all; empty if none."""
    known = np.sqrt(np.diag(_uniform_covariance(model)))
    shares = np.sqrt(np.diag(covariance)) / known
    names = [p.name for p, share in zip(model.theta, shares, strict=False) if share > unknown]
    return f"hardly anything is known of {', '.join(names)}" if names else ""


def _unrefined(
    model: KinematicModel, values: NDArray[np.float64], misfit: float, iterations: int, reason: str
) -> Refinement:
    """Return the start."""
    return Refinement(values, _uniform_covariance(model), misfit, iterations, False, reason)


def _uniform_covariance(model: KinematicModel) -> NDArray[np.float64]:
    """Return the covariance (P, P) of values that are known to lie within the limits only."""
    return np.diag(np.ptp(model.limits, axis=1) ** 2 / 12.0)


def _scan(problem: Problem, values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Improve the parameters one after another, each by trying values throughout its range."""
    best, min_misfit = values, problem.misfit(values)
    for i, (low, high) in enumerate(problem.limits):
        for value in np.linspace(low, high, problem.settings.starts.scanned):
            candidate = best.copy()
            candidate[i] = value
            misfit = problem.misfit(candidate)
            if misfit < min_misfit:
                best, min_misfit = candidate, misfit
    return best


def _above_centroid(model: KinematicModel, observation: Observation) -> NDArray[np.float64]:
    """Return the prototype, moved horizontally to the centroid of the points."""
    values = np.zeros(len(model.parameters))
    if len(observation.points):
        centroid = observation.points.mean(axis=0)
        for axis, name in enumerate("xy"):
            if ("translation", name) in model.transformation.kinds:
                values[model.transformation.kinds.index(("translation", name))] = centroid[axis]
    return np.clip(values, *model.limits.T)


def _yawed(
    model: KinematicModel, values: NDArray[np.float64], count: int
) -> list[NDArray[np.float64]]:
    """Return the values with yaws throughout their range."""
    if ("rotation", "z") not in model.transformation.kinds:
        return [values]
    yaw = model.transformation.kinds.index(("rotation", "z"))
    starts = np.repeat(values[None], count, axis=0)
    starts[:, yaw] = np.linspace(model.limits[yaw, 0], model.limits[yaw, 1], count)
    return list(starts)
