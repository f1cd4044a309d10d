"""The methods that the evaluation compares."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import islice
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kmn_perception.evaluation.networks import Networks
from kmn_perception.evaluation.registration import (
    Aligner,
    centre_to_centre,
    gicp,
    point_to_plane,
    point_to_point,
)
from kmn_perception.evaluation.settings import EvaluationSettings
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.model.observation import Observation
from kmn_perception.model.rendering import depth_to_cloud, render
from kmn_perception.network.errors import values_by_step
from kmn_perception.network.morph_network import MorphNetwork
from kmn_perception.network.weights import Weights, WeightsError
from kmn_perception.refinement import (
    Refinement,
    RefinementSettings,
    refine,
    refine_from_scratch,
)


class MethodError(ValueError):
    """A method needs what a model does not have."""


class MethodEstimate(NamedTuple):
    """Morphing parameters (n + m,), and their covariance (n + m, n + m) if the method gives it."""

    values: NDArray[np.float64]
    covariance: NDArray[np.float64] | None = None


@dataclass(frozen=True)
class Method:
    """A way to estimate morphing parameters, step by step.

    Attributes
    ----------
    estimates
        Maps an observation to the estimates after 0, 1, 2, ... steps.
    counted
        Number of the step whose estimate is the result.
    """

    estimates: Callable[[Observation], Iterator[MethodEstimate]]
    counted: int


Factory = Callable[[KinematicModel, Networks, EvaluationSettings], Method]


def baseline(model: KinematicModel, networks: Networks, settings: EvaluationSettings) -> Method:
    """Return a single prediction of the paper's network before its data were augmented."""
    network = _loaded(networks.paper).baseline
    if network is None:
        raise MethodError(f"the weights of '{model.name}' hold no baseline")
    return _iterated(network, 1)


def kmn_paper(model: KinematicModel, networks: Networks, settings: EvaluationSettings) -> Method:
    """Return N predictions of the paper's network after Algorithm 2."""
    return _iterated(_loaded(networks.paper).network, settings.steps)


def kmn(model: KinematicModel, networks: Networks, settings: EvaluationSettings) -> Method:
    """Return the last prediction of our network."""
    network = _loaded(networks.own).network
    return _iterated(network, network.steps or settings.steps)


def kmn_refined(model: KinematicModel, networks: Networks, settings: EvaluationSettings) -> Method:
    """Return the model's fit to the observation, from our network's estimate."""
    predicted, fit = kmn(model, networks, settings), RefinementSettings.load()

    def estimates(observation: Observation) -> Iterator[MethodEstimate]:
        *_, last = islice(predicted.estimates(observation), predicted.counted + 1)
        yield last
        refined = refine(model, observation, last.values, fit)
        yield _without_states(model, refined)

    return Method(estimates, counted=1)


def multistart(model: KinematicModel, networks: Networks, settings: EvaluationSettings) -> Method:
    """Return the model's fit to the observation from many starts, without a network."""
    fit = RefinementSettings.load()

    def estimates(observation: Observation) -> Iterator[MethodEstimate]:
        refined = refine_from_scratch(model, observation, fit)
        yield _without_states(model, refined)

    return Method(estimates, counted=0)


def icp(model: KinematicModel, networks: Networks, settings: EvaluationSettings) -> Method:
    """Return point-to-point ICP, from where the clouds' centres meet."""
    return _registered(model, point_to_point(_prototype(model), settings.icp))


def icp_identity(model: KinematicModel, networks: Networks, settings: EvaluationSettings) -> Method:
    """Return point-to-point ICP as in the paper: from the identity, wherever it ends."""
    aligner = point_to_point(_prototype(model), settings.icp)

    def estimates(observation: Observation) -> Iterator[MethodEstimate]:
        yield MethodEstimate(model.prototype)
        yield MethodEstimate(_values(model, aligner(observation.points, np.eye(4))))

    return Method(estimates, counted=1)


def icp_plane(model: KinematicModel, networks: Networks, settings: EvaluationSettings) -> Method:
    """Return point-to-plane ICP, from where the clouds' centres meet."""
    return _registered(model, point_to_plane(_prototype(model), settings.icp))


def generalised_icp(
    model: KinematicModel, networks: Networks, settings: EvaluationSettings
) -> Method:
    """Return generalised ICP, from where the clouds' centres meet."""
    return _registered(model, gicp(_prototype(model), settings.small_gicp))


METHODS: dict[str, Factory] = {
    "baseline": baseline,
    "kmn_paper": kmn_paper,
    "kmn": kmn,
    "kmn_refined": kmn_refined,
    "multistart": multistart,
    "icp": icp,
    "icp_identity": icp_identity,
    "icp_plane": icp_plane,
    "small_gicp": generalised_icp,
}
PEERS = ("multistart", "icp", "icp_identity", "icp_plane", "small_gicp")


def choose(
    names: Sequence[str],
    model: KinematicModel,
    networks: Networks,
    settings: EvaluationSettings,
) -> tuple[dict[str, Method], dict[str, str]]:
    """Return methods by name; of those that lack something, the reason by name."""
    chosen, left_out = {}, {}
    for name in names:
        if name not in METHODS:
            left_out[name] = f"no method for '{model.name}'"
            continue
        try:
            chosen[name] = METHODS[name](model, networks, settings)
        except MethodError as error:
            left_out[name] = str(error)
    return chosen, left_out


def _without_states(model: KinematicModel, fit: Refinement) -> MethodEstimate:
    count = len(model.parameters)
    return MethodEstimate(fit.values[:count], fit.covariance[:count, :count])


def _loaded(weights: Weights | WeightsError) -> Weights:
    if isinstance(weights, WeightsError):
        raise MethodError(str(weights)) from weights
    return weights


def _iterated(network: MorphNetwork, counted: int) -> Method:
    def estimates(observation: Observation) -> Iterator[MethodEstimate]:
        return (MethodEstimate(values[0]) for values in values_by_step(network, [observation]))

    return Method(estimates, counted)


def _prototype(model: KinematicModel) -> NDArray[np.float32]:
    """Return the prototype's cloud, as the canonical camera sees it."""
    depth = render(model.prototype_cubes, model.camera, model.cylinder_axes)
    return depth_to_cloud(depth, model.camera)


def _registered(model: KinematicModel, aligner: Aligner) -> Method:
    """Return a registration from where the clouds' centres meet, kept within the limits.

    Scales and gamma stay 0: a rigid motion has none.
    """
    prototype = _prototype(model)

    def estimates(observation: Observation) -> Iterator[MethodEstimate]:
        start = centre_to_centre(observation.points, prototype)
        for to_prototype in (start, aligner(observation.points, start)):
            yield MethodEstimate(np.clip(_values(model, to_prototype), *model.limits.T))

    return Method(estimates, counted=1)


def _values(model: KinematicModel, to_prototype: NDArray[np.float64]) -> NDArray[np.float64]:
    theta = model.transformation.read_back(np.linalg.inv(to_prototype))
    return np.concatenate((theta, np.zeros(len(model.gamma))))
