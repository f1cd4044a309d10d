"""The estimator's verdicts, with the shipped weights of the door and points of known origin."""

from dataclasses import replace

import numpy as np
import pytest

from kmn_perception.estimate import Status
from kmn_perception.estimator import EstimatorSettings, MorphEstimator
from kmn_perception.model.observation import Observation
from kmn_perception.model.rendering import depth_to_cloud, render

SETTINGS = EstimatorSettings(
    iterations=10,
    tolerance=0.02,
    min_points=100,
    max_residual=0.03,
    max_deviation=0.1,
    deviation_share=0.9,
    limit_margin=0.1,
    shape_error=0.0,
    calibration_error=0.0,
    refine=True,
)


@pytest.fixture(scope="module")
def door() -> MorphEstimator:
    return MorphEstimator.load("door", "", SETTINGS)


@pytest.fixture(scope="module")
def network_alone(door: MorphEstimator) -> MorphEstimator:
    return MorphEstimator(
        door.model, door.network, replace(SETTINGS, refine=False), door.refinement
    )


def observe(estimator: MorphEstimator, theta: list, gamma: list) -> Observation:
    model = estimator.model
    depth = render(model.unit_cubes(theta, gamma), model.camera)
    return Observation(depth_to_cloud(depth, model.camera), model.camera)


THETA, GAMMA = [0.2, -0.1, 0.3], [0.05, -0.1, 0.01, 0.06]


def test_a_door_in_view_is_known_to_a_fraction_of_a_millimetre(door: MorphEstimator) -> None:
    estimate = door.estimate(observe(door, THETA, GAMMA))
    assert (estimate.status, estimate.reason) == (Status.OK, "")
    assert estimate.converged
    assert estimate.residual < 1e-4
    np.testing.assert_allclose(estimate.theta, THETA, atol=2e-4)
    np.testing.assert_allclose(estimate.gamma, GAMMA, atol=5e-4)
    np.testing.assert_allclose(estimate.transform, door.model.transformation.matrix(estimate.theta))
    assert 0.0 < np.sqrt(np.diag(estimate.covariance)).max() < 0.002


def test_the_network_alone_is_near_and_knows_no_covariance(network_alone: MorphEstimator) -> None:
    estimate = network_alone.estimate(observe(network_alone, THETA, GAMMA))
    assert (estimate.status, estimate.reason) == (Status.OK, "")
    np.testing.assert_allclose(estimate.theta, THETA, atol=0.01)
    np.testing.assert_allclose(estimate.gamma, GAMMA, atol=0.02)
    assert np.isnan(estimate.covariance).all()
    assert estimate.covariance.shape == (7, 7)


def test_a_door_whose_top_is_out_of_view_says_what_is_not_known(door: MorphEstimator) -> None:
    """Only height / 2 + handle_z, the handle's height, is known."""
    theta, gamma = [-0.75, 0.0, 0.0], [0.1, 0.0, 0.0, -0.05]
    estimate = door.estimate(observe(door, theta, gamma))
    deviation = np.sqrt(np.diag(estimate.covariance))
    assert deviation[3] > 0.01
    handle_height = np.array([0.0, 0.0, 0.0, 0.5, 0.0, 0.0, 1.0])
    assert np.sqrt(handle_height @ estimate.covariance @ handle_height) < 0.002
    found = handle_height[3:] @ estimate.gamma
    assert found == pytest.approx(handle_height[3:] @ gamma, abs=0.002)


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


@pytest.mark.parametrize("kind", ["heap", "box", "two doors", "half hidden"])
def test_what_is_not_one_door_in_full_is_not_ok(door: MorphEstimator, kind: str) -> None:
    points = observe(door, THETA, GAMMA).points
    generator = np.random.default_rng(0)
    seen = {
        "heap": generator.uniform([-0.5, -0.5, 0.0], [0.5, 0.5, 1.0], (5000, 3)),
        "box": points[(points[:, 2] < 0.6)] * [1.0, 0.6, 0.6],
        "two doors": np.concatenate((points, points + [0.5, 0.7, 0.0])),
        "half hidden": points[points[:, 2] + points[:, 1] > 1.0],
    }[kind]
    estimate = door.estimate(Observation(seen.astype(np.float32), door.model.camera))
    assert estimate.status is not Status.OK
    assert estimate.reason


@pytest.mark.parametrize("share", [0.9, 0.97])
def test_the_share_says_how_much_may_hide_a_door(door: MorphEstimator, share: float) -> None:
    """A sheet before the door hides and shows 5 % of its points."""
    whole = observe(door, THETA, GAMMA)
    points = whole.points.copy()
    order = np.argsort(np.linalg.norm(points[:, 1:] - np.median(points[:, 1:], axis=0), axis=1))
    camera = door.model.camera.pose[:3, 3]
    hidden = order[: round(0.05 * len(points))]
    points[hidden] = camera + 0.85 * (points[hidden] - camera)
    strict = MorphEstimator(
        door.model, door.network, replace(SETTINGS, deviation_share=share), door.refinement
    )
    estimate = strict.estimate(replace(whole, points=points))
    if share < 0.95:
        assert (estimate.status, estimate.reason) == (Status.OK, "")
        np.testing.assert_allclose(estimate.theta, THETA, atol=0.005)
    else:
        assert estimate.status is Status.NOT_CONVERGED
        assert estimate.reason.startswith("97 % of the points lie up to 0.")


def test_a_door_far_outside_is_not_ok(door: MorphEstimator) -> None:
    estimate = door.estimate(observe(door, [3.0, 0.0, 0.0], [0.0] * 4))
    assert estimate.status is not Status.OK
    assert estimate.reason


def test_a_prediction_that_has_not_settled_is_reported(network_alone: MorphEstimator) -> None:
    hasty = MorphEstimator(
        network_alone.model,
        network_alone.network,
        replace(network_alone.settings, iterations=1),
        network_alone.refinement,
    )
    estimate = hasty.estimate(observe(hasty, [0.5, 0.3, -0.8], [0.0] * 4))
    assert not estimate.converged
    assert estimate.iterations == 1
    assert estimate.status is Status.NOT_CONVERGED
    assert "still changed theta by" in estimate.reason
