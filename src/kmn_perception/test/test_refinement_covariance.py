"""The covariance tells what a view does not show, and is neither too small nor too large."""

from __future__ import annotations

import numpy as np
import pytest

from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.refinement import RefinementSettings, refine
from kmn_perception.training.samples import EVALUATION, observe, sample

SETTINGS = RefinementSettings.load()
X, Y, YAW, HEIGHT, WIDTH, HANDLE_Y, HANDLE_Z = range(7)
CHI2_95 = {3: 7.815, 5: 11.070, 7: 14.067}  # 95 % quantiles, Abramowitz and Stegun, table 26.8


def test_a_door_whose_top_is_out_of_view_shows_only_height_and_handle_together() -> None:
    """Its handle is at height / 2 + handle_z, which is seen; its top could be anywhere above."""
    door = KinematicModel.load("door")
    truth = np.array([-0.5, 0.0, 0.2, 0.1, 0.0, 0.01, 0.02])
    observation = observe(door, truth, door.camera, "none", np.random.default_rng(0))
    result = refine(door, observation, truth + 0.01, SETTINGS)
    eigenvalues, directions = np.linalg.eigh(result.covariance)
    hidden = np.zeros(7)
    hidden[[HEIGHT, HANDLE_Z]] = 1.0, -0.5
    hidden /= np.linalg.norm(hidden)
    assert abs(directions[:, -1] @ hidden) > 0.9999
    assert np.sqrt(eigenvalues[-1]) > 0.04
    assert np.sqrt(eigenvalues[-2]) < 0.002
    certain = np.zeros(7)
    certain[[HEIGHT, HANDLE_Z]] = 0.5, 1.0
    assert np.sqrt(certain @ result.covariance @ certain) < 0.001
    assert certain @ result.values == pytest.approx(certain @ truth, abs=5e-4)


def test_the_estimate_is_the_middle_of_what_is_possible() -> None:
    """The top is above the upper border of the image, and the handle within its limits."""
    door = KinematicModel.load("door")
    truth = np.array([-0.5, 0.0, 0.2, 0.1, 0.0, 0.01, 0.02])
    observation = observe(door, truth, door.camera, "none", np.random.default_rng(0))
    result = refine(door, observation, truth + 0.01, SETTINGS)
    possible = []
    for height in np.linspace(door.limits[HEIGHT, 0], door.limits[HEIGHT, 1], 121):
        values = truth.copy()
        values[HEIGHT] = height
        values[HANDLE_Z] += 0.5 * (truth[HEIGHT] - height)
        low, high = door.limits[HANDLE_Z]
        other = observe(door, values, door.camera, "none", np.random.default_rng(0))
        same = len(other.points) == len(observation.points)
        if low <= values[HANDLE_Z] <= high and same:
            possible.append(height)
    middle = 0.5 * (possible[0] + possible[-1])
    assert result.values[HEIGHT] == pytest.approx(middle, abs=0.01)
    spread = np.sqrt(result.covariance[HEIGHT, HEIGHT])
    assert spread == pytest.approx((possible[-1] - possible[0]) / np.sqrt(12.0), rel=0.1)


def test_a_box_with_one_end_out_of_view_may_be_longer() -> None:
    """Moving the hidden end by 2 d moves the centre by d, along the box's own y axis."""
    box = KinematicModel.load("box_c")
    truth = np.array([-0.325, -0.35, 0.07, 0.02, 0.23])
    observation = observe(box, truth, box.camera, "none", np.random.default_rng(0))
    lowest = box.camera.project(observation.points)[:, 1].max()
    assert lowest == pytest.approx(box.camera.height - 1, abs=0.01)
    result = refine(box, observation, truth + 0.01, SETTINGS)
    eigenvalues, directions = np.linalg.eigh(result.covariance)
    yaw, length = truth[2], 0.4  # of the prototype: a scaling by s moves the end by 0.4 s
    hidden = np.array([np.sin(yaw), -np.cos(yaw), 0.0, 2.0 / length, 0.0])
    hidden /= np.linalg.norm(hidden)
    assert abs(directions[:, -1] @ hidden) > 0.9999
    assert np.sqrt(eigenvalues[-1]) > 0.05
    assert np.sqrt(eigenvalues[-2]) < 0.002


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("box_b", [-0.1, 0.05, 0.4]),
        ("box_c", [0.05, 0.1, -0.5, -0.2, 0.6]),
        ("door", [0.6, 0.1, 0.3, -0.3, 0.1, 0.02, -0.05]),
    ],
)
def test_an_object_entirely_in_view_is_certain(name: str, values: list[float]) -> None:
    model = KinematicModel.load(name)
    truth = np.array(values)
    observation = observe(model, truth, model.camera, "none", np.random.default_rng(0))
    result = refine(model, observation, truth, SETTINGS)
    assert np.sqrt(np.linalg.eigvalsh(result.covariance)[-1]) < 0.003


@pytest.mark.parametrize("noise", ["mm", "kinect"])
@pytest.mark.parametrize("name", ["box_b", "box_c", "door"])
def test_the_ellipsoid_of_95_percent_holds_most_of_the_truths(name: str, noise: str) -> None:
    model = KinematicModel.load(name)
    inside, count = 0, 60
    for index in range(count):
        observation, truth = sample(model, 5, index, None, noise, EVALUATION)
        start = truth + np.random.default_rng(index).uniform(-0.01, 0.01, size=len(truth))
        result = refine(model, observation, start, SETTINGS)
        error = result.values - truth
        distance = error @ np.linalg.solve(result.covariance, error)
        inside += bool(distance <= CHI2_95[len(truth)])
    assert inside / count >= 0.8


def test_more_noise_is_more_uncertainty() -> None:
    box = KinematicModel.load("box_b")
    truth = np.array([-0.1, 0.05, 0.4])
    spreads = []
    for noise in ("none", "mm", "kinect"):
        observation = observe(box, truth, box.camera, noise, np.random.default_rng(0))
        covariance = refine(box, observation, truth, SETTINGS).covariance
        spreads.append(np.sqrt(np.trace(covariance)))
    assert spreads[0] < spreads[1] < spreads[2] < 0.002


def test_a_start_that_is_kept_has_a_covariance_that_holds_the_truth() -> None:
    """Noise may make a start explain a little more than the fit; it is then returned."""
    box = KinematicModel.load("box_a")
    observation, truth = sample(box, 33, 686, None, "kinect", EVALUATION)
    start = truth + [0.0, 4e-4]
    result = refine(box, observation, start, SETTINGS)
    assert not result.improved
    assert result.reason == ""
    np.testing.assert_array_equal(result.values, start)
    error = start - truth
    assert error @ np.linalg.solve(result.covariance, error) < 9.0
    assert np.sqrt(np.trace(result.covariance)) < 0.001
