"""The methods that the evaluation compares."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from kmn_perception.evaluation.errors import values_by_step
from kmn_perception.evaluation.icp import align
from kmn_perception.evaluation.settings import EvaluationSettings
from kmn_perception.kinematic_model import KinematicModel
from kmn_perception.network import MorphNetwork
from kmn_perception.observation import Observation
from kmn_perception.rendering import depth_to_cloud, render
from kmn_perception.weights import Weights


class MethodError(ValueError):
    """A method does not apply to a model."""


@dataclass(frozen=True)
class Method:
    """A way to estimate morphing parameters, step by step.

    Attributes
    ----------
    estimates
        Maps an observation to the estimates (n + m,) after 0, 1, 2, ... steps.
    counted
        Number of the step whose estimate is the result.
    """

    estimates: Callable[[Observation], Iterator[NDArray[np.float64]]]
    counted: int


def baseline(model: KinematicModel, weights: Weights, settings: EvaluationSettings) -> Method:
    """Return a single prediction of the network before its data were augmented."""
    if weights.baseline is None:
        raise MethodError(f"the weights of '{model.name}' hold no baseline")
    return _iterated(weights.baseline, 1)


def kmn(model: KinematicModel, weights: Weights, settings: EvaluationSettings) -> Method:
    """Return the last prediction of the network, or the N-th if it may go on and on."""
    return _iterated(weights.network, weights.network.steps or settings.steps)


def _iterated(network: MorphNetwork, counted: int) -> Method:
    def estimates(observation: Observation) -> Iterator[NDArray[np.float64]]:
        return (values[0] for values in values_by_step(network, [observation]))

    return Method(estimates, counted)


def icp(model: KinematicModel, weights: Weights, settings: EvaluationSettings) -> Method:
    """Return the alignment of the cloud with that of the prototype, from the canonical camera.

    Raises
    ------
    MethodError
        If the model has parameters that no rigid motion has.
    """
    if model.gamma or any(kind == "scale" for kind, _ in model.transformation.kinds):
        raise MethodError(f"icp does not apply to '{model.name}': it has scales or gamma")
    zero = np.zeros(len(model.theta))
    prototype = depth_to_cloud(render(model.unit_cubes(zero, ()), model.camera), model.camera)

    def estimates(observation: Observation) -> Iterator[NDArray[np.float64]]:
        yield zero
        cloud = observation.points
        count = min(len(cloud), settings.icp_points)
        drawn = np.random.default_rng(0).choice(len(cloud), count, replace=False)
        to_prototype = align(cloud[drawn], prototype, settings.icp_iterations)
        yield model.transformation.read_back(np.linalg.inv(to_prototype))

    return Method(estimates, counted=1)


METHODS: dict[str, Callable[[KinematicModel, Weights, EvaluationSettings], Method]] = {
    "baseline": baseline,
    "kmn": kmn,
    "icp": icp,
}


def choose(
    names: list[str] | None, model: KinematicModel, weights: Weights, settings: EvaluationSettings
) -> dict[str, Method]:
    """Return the methods of these names; without names, all that apply to the model.

    Raises
    ------
    MethodError
        If a method that was named does not apply to the model.
    """
    chosen = {}
    for name in names or METHODS:
        try:
            chosen[name] = METHODS[name](model, weights, settings)
        except MethodError:
            if names:
                raise
    return chosen
