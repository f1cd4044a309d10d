"""The estimator's verdicts, with the shipped weights of the door and points of known origin."""

from dataclasses import replace

import numpy as np
import pytest

from kmn_perception.estimator import EstimatorSettings, MorphEstimator, Status
from kmn_perception.observation import Observation
from kmn_perception.rendering import depth_to_cloud, render

SETTINGS = EstimatorSettings(
    iterations=10, tolerance=0.02, min_points=100, max_residual=0.05, limit_margin=0.1
)


@pytest.fixture(scope="module")
def door() -> MorphEstimator:
    return MorphEstimator.load("door", "", SETTINGS)


def observe(estimator: MorphEstimator, theta: list, gamma: list) -> Observation:
    model = estimator.model
    depth = render(model.unit_cubes(theta, gamma), model.camera)
    return Observation(depth_to_cloud(depth, model.camera), model.camera)


def test_a_door_in_view_is_ok_and_its_points_lie_on_the_model(door: MorphEstimator) -> None:
    theta, gamma = [0.2, -0.1, 0.3], [0.05, -0.1, 0.0, 0.0]
    estimate = door.estimate(observe(door, theta, gamma))
    assert (estimate.status, estimate.reason) == (Status.OK, "")
    assert estimate.converged
    assert estimate.residual < 0.02
    np.testing.assert_allclose(estimate.theta, theta, atol=0.06)
    np.testing.assert_allclose(estimate.transform, door.model.transformation.matrix(estimate.theta))
    assert np.isnan(estimate.covariance).all()
    assert estimate.covariance.shape == (7, 7)


def test_no_points_are_no_object(door: MorphEstimator) -> None:
    nothing = np.empty((0, 3), dtype=np.float32)
    estimate = door.estimate(Observation(nothing, door.model.camera))
    assert estimate.status is Status.NO_OBJECT
    assert np.isnan(estimate.theta).all()
    assert np.isnan(estimate.residual)


def test_few_points_are_counted(door: MorphEstimator) -> None:
    whole = observe(door, [0.0] * 3, [0.0] * 4)
    estimate = door.estimate(replace(whole, points=whole.points[:50]))
    assert estimate.status is Status.TOO_FEW_POINTS
    assert estimate.reason == "50 points, at least 100 are needed"
    assert estimate.points_used == 50


def test_a_box_is_not_taken_for_a_door(door: MorphEstimator) -> None:
    generator = np.random.default_rng(0)
    heap = generator.uniform([-0.5, -0.5, 0.0], [0.5, 0.5, 1.0], (5000, 3)).astype(np.float32)
    assert door.estimate(Observation(heap, door.model.camera)).status is not Status.OK


def test_a_door_far_outside_is_not_ok(door: MorphEstimator) -> None:
    estimate = door.estimate(observe(door, [3.0, 0.0, 0.0], [0.0] * 4))
    assert estimate.status is not Status.OK
    assert estimate.reason


def test_too_few_iterations_are_reported(door: MorphEstimator) -> None:
    hasty = MorphEstimator(door.model, door.network, replace(SETTINGS, iterations=1))
    estimate = hasty.estimate(observe(door, [0.5, 0.3, -0.8], [0.0] * 4))
    assert not estimate.converged
    assert estimate.iterations == 1
    assert estimate.status is Status.NOT_CONVERGED
    assert "still changed theta by" in estimate.reason
