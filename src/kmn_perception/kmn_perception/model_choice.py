"""Which of several models an object is one of, or that it is one of none."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kmn_perception.estimate import Estimate, Status
from kmn_perception.estimator import EstimatorSettings, MorphEstimator
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.model.observation import Observation
from kmn_perception.network.morph import predict
from kmn_perception.refinement import fit_once, log_evidence
from kmn_perception.refinement.problem import Problem


class Start(NamedTuple):
    """What the network of a model sees in an object: values (P,), and their misfit."""

    estimator: MorphEstimator
    values: NDArray[np.float64]
    misfit: float


class Candidate(NamedTuple):
    """An estimate of an object by one of the models, and the logarithm of its evidence."""

    estimate: Estimate
    log_evidence: float


class ModelChoice:
    """Explains each object by every model, and keeps the estimate of the one that does it best.

    Raises
    ------
    ValueError
        If models have the same name, by which messages tell them apart.
    """

    def __init__(self, estimators: Sequence[MorphEstimator]) -> None:
        names = [estimator.model.name for estimator in estimators]
        if len(set(names)) != len(names):
            raise ValueError(f"the names of models must differ, found {', '.join(names)}")
        self._estimators = tuple(estimators)
        self._settings = estimators[0].refinement.evidence

    @property
    def models(self) -> tuple[KinematicModel, ...]:
        """By which objects are explained."""
        return tuple(estimator.model for estimator in self._estimators)

    @property
    def settings(self) -> EstimatorSettings:
        """Of all models."""
        return self._estimators[0].settings

    def configured(self, settings: EstimatorSettings) -> ModelChoice:
        """Return the same choice with other settings."""
        return ModelChoice([estimator.configured(settings) for estimator in self._estimators])

    def warm_up(self) -> None:
        """Compile and load all that the first estimate needs, so that it is not slow."""
        for estimator in self._estimators:
            estimator.warm_up()

    def estimate(self, observation: Observation) -> Estimate:
        """Estimate the morphing parameters of an object from points that show nothing else.

        The models are gone through in the order of what their networks see in it. Most time goes to
        fits of wrong models: once one is OK, another one is fitted without a covariance, and no
        further where that explains less. Where none is OK, the best is tried from other starts.
        """
        if len(observation.points) < max(self.settings.min_points, 1):
            return self._estimators[0].estimate(observation)
        starts = [_start(estimator, observation) for estimator in self._estimators]
        found: list[Candidate] = []
        for start in sorted(starts, key=lambda start: start.misfit):
            is_explained = any(each.estimate.status is Status.OK for each in found)
            most = max((each.log_evidence for each in found), default=-math.inf)
            if not is_explained or self._may_be_as_good(start, observation, most):
                found.append(_candidate(_without_retries(start.estimator), observation))
        best = best_explained(found, self._settings.equal)
        if best.status in (Status.OK, Status.AMBIGUOUS):
            return best
        retried = next(each for each in self._estimators if each.model is best.model)
        others = [each for each in found if each.estimate.model is not best.model]
        return best_explained([*others, _candidate(retried, observation)], self._settings.equal)

    def estimate_all(self, observations: Sequence[Observation]) -> list[Estimate]:
        """Estimate the morphing parameters of several objects."""
        return [self.estimate(observation) for observation in observations]

    def _may_be_as_good(self, start: Start, observation: Observation, most: float) -> bool:
        """Tell whether a fit from a start has about the most evidence so far."""
        if start.misfit > self._settings.hopeless:
            return False
        estimator, values = start.estimator, start.values
        if self.settings.refine:
            values = fit_once(estimator.model, observation, values, estimator.refinement)
        found = log_evidence(estimator.model, observation, values, estimator.refinement)
        return most - found <= self._settings.equal


def best_explained(candidates: Sequence[Candidate], equal: float) -> Estimate:
    """Return the estimate with the most evidence; that of an object of no model says so.

    An estimate that is not OK counts all the same: where it explains the object better than all
    that are OK, the object is none of theirs.

    Parameters
    ----------
    candidates
        Of one object, of different models.
    equal
        Log-evidences that differ by no more are equal.
    """
    ranked = sorted(candidates, key=lambda candidate: -candidate.log_evidence)
    best, most = ranked[0].estimate, ranked[0].log_evidence
    if not math.isfinite(most):
        return best  # there was nothing to explain
    equals = [each.estimate for each in ranked if most - each.log_evidence <= equal]
    valid = [estimate for estimate in equals if estimate.status is Status.OK]
    if not valid:
        reason = f"'{best.model.name}' explains it best, and not well enough: {best.reason}"
        return replace(best, reason=reason)
    if len(valid) > 1:
        names = " and ".join(f"'{estimate.model.name}'" for estimate in valid)
        reason = f"{names} explain it equally well; the parameters are of the first"
        return replace(valid[0], status=Status.AMBIGUOUS, reason=reason, converged=False)
    return valid[0]


def _start(estimator: MorphEstimator, observation: Observation) -> Start:
    settings = estimator.settings
    prediction, _ = predict(
        estimator.network, [observation], settings.iterations, settings.tolerance
    )
    values = prediction.values[0]
    misfit = Problem.of(estimator.model, observation, estimator.refinement).misfit(values)
    return Start(estimator, values, misfit)


def _without_retries(estimator: MorphEstimator) -> MorphEstimator:
    refinement = estimator.refinement.without_retries()
    return MorphEstimator(estimator.model, estimator.network, estimator.settings, refinement)


def _candidate(estimator: MorphEstimator, observation: Observation) -> Candidate:
    estimate = estimator.estimate(observation)
    return Candidate(estimate, _log_evidence(estimator, observation, estimate))


def _log_evidence(estimator: MorphEstimator, observation: Observation, estimate: Estimate) -> float:
    """Return the logarithm of the evidence for a model; minus infinity without an estimate."""
    positions = [joint.value for joint in estimate.joints]
    values = np.array([*estimate.theta, *estimate.gamma, *positions])
    if not np.isfinite(values).all():
        return -math.inf
    return log_evidence(estimator.model, observation, values, estimator.refinement)
