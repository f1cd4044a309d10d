"""From an object's point cloud to morphing parameters that can be trusted, or a reason why not."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from kmn_perception.estimate import Estimate, Quantity, Status
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.model.observation import Observation
from kmn_perception.model.rendering import depth_to_cloud, render
from kmn_perception.model.surface_distance import surface_distances
from kmn_perception.network import weights
from kmn_perception.network.morph import predict
from kmn_perception.network.morph_network import MorphNetwork
from kmn_perception.refinement import RefinementSettings, refine
from kmn_perception.refinement.calibration import calibration_covariance
from kmn_perception.refinement.geometry import shape_of


@dataclass(frozen=True)
class EstimatorSettings:
    """Settings of the iterative prediction and of its checks.

    Attributes
    ----------
    iterations
        Largest number N of predictions.
    tolerance
        Converged when a step changes no transformation parameter by more than this (m, rad, 1).
    min_points
        Fewer points than this are not estimated.
    max_residual
        Largest median distance of the points to the predicted surface, metres.
    max_deviation
        Largest distance of most points to the predicted surface, metres.
    deviation_share
        Share of the points that must lie within it, whatever the others show.
    limit_margin
        By how much of its range a parameter may lie beyond its limits.
    shape_error
        Standard deviation by which faces and edges of the object lie off those of the model,
        metres.
    calibration_error
        Standard deviation of the share by which depths and focal lengths are wrong.
    refine
        Fit the model to the observation after the predictions.
    """

    iterations: int
    tolerance: float
    min_points: int
    max_residual: float
    max_deviation: float
    deviation_share: float
    limit_margin: float
    shape_error: float
    calibration_error: float
    refine: bool


class MorphEstimator:
    """Runs the kinematic morphing network of one model, and refines what it predicts.

    Attributes
    ----------
    model, network, settings, refinement
        May be replaced between two estimates.
    """

    def __init__(
        self,
        model: KinematicModel,
        network: MorphNetwork,
        settings: EstimatorSettings,
        refinement: RefinementSettings,
    ) -> None:
        self.model, self.network = model, network
        self.settings, self.refinement = settings, refinement

    @classmethod
    def load(
        cls, model: str | Path, weights_file: str | Path, settings: EstimatorSettings
    ) -> MorphEstimator:
        """Load a model and its weights; where no file is told, those of `default_file`.

        Raises
        ------
        FileNotFoundError, ConfigurationError
            If the model's file is missing or wrong.
        WeightsError
            If the weights are missing, corrupt, or of another model.
        """
        kinematic_model = KinematicModel.load(model)
        file = weights_file or weights.default_file(kinematic_model)
        network = weights.load(file, kinematic_model).network
        return cls(kinematic_model, network, settings, RefinementSettings.load())

    @property
    def models(self) -> tuple[KinematicModel, ...]:
        """The one model."""
        return (self.model,)

    def configured(self, settings: EstimatorSettings) -> MorphEstimator:
        """Return the estimator with other settings, which shares model and network."""
        return MorphEstimator(self.model, self.network, settings, self.refinement)

    def warm_up(self) -> None:
        """Compile and load all that the first estimate needs, so that it is not slow."""
        camera = self.model.camera
        depth = render(self.model.prototype_cubes, camera, self.model.cylinder_axes)
        points = depth_to_cloud(depth, camera)
        self.estimate(Observation(points, camera))
        self.estimate(Observation(points, camera, depth=depth))

    def estimate(self, observation: Observation) -> Estimate:
        """Estimate the morphing parameters of an object from points that show nothing else."""
        return self.estimate_all([observation])[0]

    def estimate_all(self, observations: Sequence[Observation]) -> list[Estimate]:
        """Estimate the morphing parameters of several objects, predicted together."""
        enough = [o for o in observations if len(o.points) >= max(self.settings.min_points, 1)]
        if not enough:
            return [self._too_few(observation) for observation in observations]
        prediction, iterations = predict(
            self.network, enough, self.settings.iterations, self.settings.tolerance
        )
        estimates = (
            self._finish(observation, values, float(change), iterations)
            for observation, values, change in zip(
                enough, prediction.values, prediction.change, strict=True
            )
        )
        return [
            next(estimates) if observation in enough else self._too_few(observation)
            for observation in observations
        ]

    def _too_few(self, observation: Observation) -> Estimate:
        count = len(observation.points)
        if count == 0:
            return Estimate.none(self.model, 0, Status.NO_OBJECT, "no points of an object")
        reason = f"{count} points, at least {self.settings.min_points} are needed"
        return Estimate.none(self.model, count, Status.TOO_FEW_POINTS, reason)

    def _finish(
        self, observation: Observation, values: NDArray[np.float64], change: float, iterations: int
    ) -> Estimate:
        """Refine what was predicted, and judge it."""
        model, points, count = self.model, observation.points, len(values)
        covariance: NDArray[np.float64] = np.full((count, count), np.nan)
        if self.settings.refine:
            fit = refine(model, observation, values, self.refinement, self.settings.shape_error)
            values, doubt = fit.values, fit.reason
            shape, calibration = shape_of(model, model.states), self.settings.calibration_error
            covariance = fit.covariance + calibration_covariance(
                shape, values, observation.camera, calibration
            )
        else:
            doubt = self._doubt(change)
        deviations = np.sqrt(np.diag(covariance))[count:].tolist()
        states = zip(model.states, values[count:].tolist(), deviations, strict=False)
        joints = tuple(Quantity(joint.name, *state) for joint, *state in states)
        theta, gamma = model.split(values[:count])
        positions = {joint.name: joint.value for joint in joints}
        cubes = model.moved_cubes(values[:count], positions)
        distances = surface_distances(cubes, points, model.cylinder_axes)
        residual, deviation = np.quantile(distances, (0.5, self.settings.deviation_share)).tolist()
        status, reason = self._judge(values, residual, deviation, doubt)
        return Estimate(
            model=model,
            theta=theta,
            gamma=gamma,
            covariance=covariance[:count, :count],
            transform=model.transformation.matrix(theta),
            iterations=iterations,
            converged=not doubt,
            residual=residual,
            points_used=len(points),
            status=status,
            reason=reason,
            joints=joints,
        )

    def _doubt(self, change: float) -> str:
        """Return why a prediction that changed theta by so much is not the last one."""
        if change <= self.settings.tolerance:
            return ""
        return (
            f"the last prediction still changed theta by {change:.3f}, "
            f"more than {self.settings.tolerance:g}"
        )

    def _judge(
        self, values: NDArray[np.float64], residual: float, deviation: float, doubt: str
    ) -> tuple[Status, str]:
        """Return the status of an estimate, and the reason if it is not OK."""
        settings = self.settings
        for parameter, value in zip(self.model.estimated, values, strict=False):
            low, high = parameter.limits
            slack = settings.limit_margin * (high - low)
            if not low - slack <= value <= high + slack:
                unit = f" {parameter.unit}" if parameter.unit else ""
                reason = f"{parameter.name} = {value:.3f} is outside [{low:g}, {high:g}]{unit}"
                return Status.OUT_OF_LIMITS, reason
        if not residual <= settings.max_residual:
            return Status.NOT_CONVERGED, (
                f"the points lie {residual:.3f} m from the model, "
                f"more than {settings.max_residual:g} m"
            )
        if not deviation <= settings.max_deviation:
            return Status.NOT_CONVERGED, (
                f"{100.0 * settings.deviation_share:g} % of the points lie up to {deviation:.3f} m "
                f"from the model, {settings.max_deviation:g} m are allowed: it is of another shape"
            )
        return (Status.NOT_CONVERGED, doubt) if doubt else (Status.OK, "")
