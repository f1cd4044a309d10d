"""Other starts of the fit than the network's estimate."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.model.observation import Observation
from kmn_perception.refinement.problem import Problem
from kmn_perception.refinement.start_settings import StartSettings


def above_centroid(model: KinematicModel, observation: Observation) -> NDArray[np.float64]:
    """Return the prototype, moved horizontally to the centroid of the points."""
    values = np.zeros(len(model.parameters))
    if len(observation.points):
        centroid = observation.points.mean(axis=0)
        for axis, name in enumerate("xy"):
            if ("translation", name) in model.transformation.kinds:
                values[model.transformation.kinds.index(("translation", name))] = centroid[axis]
    return np.clip(values, *model.limits.T)


def yawed(
    model: KinematicModel, values: NDArray[np.float64], count: int
) -> list[NDArray[np.float64]]:
    """Return the values with yaws throughout their range."""
    if ("rotation", "z") not in model.transformation.kinds:
        return [values]
    yaw = model.transformation.kinds.index(("rotation", "z"))
    starts = np.repeat(values[None], count, axis=0)
    starts[:, yaw] = np.linspace(model.limits[yaw, 0], model.limits[yaw, 1], count)
    return list(starts)


def scanned(problem: Problem, values: NDArray[np.float64]) -> NDArray[np.float64]:
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


def around(
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


def with_joints_moved(problem: Problem, values: NDArray[np.float64]) -> list[NDArray[np.float64]]:
    """Return starts (P,) with the joints throughout their limits, one after another.

    Parameters
    ----------
    values
        (n + m,) of (theta, gamma).
    """
    first = len(values)
    at_rest = np.concatenate([values, np.zeros(len(problem.limits) - first)])
    found = [at_rest]
    for joint in range(first, len(at_rest)):
        low, high = problem.limits[joint]
        for position in np.linspace(low, high, problem.settings.starts.scanned):
            moved = at_rest.copy()
            moved[joint] = position
            found.append(moved)
    return found
