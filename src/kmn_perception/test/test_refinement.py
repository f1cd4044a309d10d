"""The refinement finds the truth, explains what was seen, and says when it cannot."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from kmn_perception.configuration import resources
from kmn_perception.configuration.section import ConfigurationError
from kmn_perception.model.camera import look_at
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.model.observation import Observation
from kmn_perception.refinement import RefinementSettings, refine, refine_from_scratch
from kmn_perception.refinement.problem import Problem
from kmn_perception.training.samples import EVALUATION, observe, sample

Vector = NDArray[np.float64]

SETTINGS = RefinementSettings.load()
IN_VIEW = {
    "box_a": [0.1, -0.05],
    "box_b": [-0.1, 0.05, 0.4],
    "box_c": [0.05, 0.1, -0.5, -0.2, 0.6],
    "box": [0.1, 0.05, 0.3, 0.2, -0.4, 0.5],
    "door": [0.6, 0.1, 0.3, -0.3, 0.1, 0.02, -0.05],
}  # entirely in view of the canonical cameras


def seen(model: KinematicModel, values: Vector, noise: str = "none") -> Observation:
    return observe(model, values, model.camera, noise, np.random.default_rng(1))


def perturbed(model: KinematicModel, values: Vector, size: float, seed: int) -> Vector:
    """Return values off by up to ``size`` (m, rad, or as a scale)."""
    shift = np.random.default_rng(seed).uniform(-size, size, size=len(values))
    return np.clip(values + shift, *model.limits.T)


@pytest.fixture(params=IN_VIEW)
def model(request: pytest.FixtureRequest) -> KinematicModel:
    return KinematicModel.load(request.param)


def test_a_start_at_the_truth_stays_there(model: KinematicModel) -> None:
    truth = np.array(IN_VIEW[model.name])
    result = refine(model, seen(model, truth), truth, SETTINGS)
    assert result.reason == ""
    np.testing.assert_allclose(result.values, truth, atol=2e-4)


@pytest.mark.parametrize("size", [0.01, 0.04])
def test_perturbed_starts_converge(model: KinematicModel, size: float) -> None:
    truth = np.array(IN_VIEW[model.name])
    observation = seen(model, truth)
    for seed in range(3):
        start = perturbed(model, truth, size, seed)
        result = refine(model, observation, start, SETTINGS)
        assert result.improved
        np.testing.assert_allclose(result.values, truth, atol=3e-4)


def test_noise_of_a_kinect_leaves_millimetres() -> None:
    model = KinematicModel.load("box_b")
    truth = np.array(IN_VIEW["box_b"])
    result = refine(model, seen(model, truth, "kinect"), perturbed(model, truth, 0.02, 1), SETTINGS)
    np.testing.assert_allclose(result.values, truth, atol=2e-3)


@pytest.mark.parametrize("position", [(0.7, -0.4, 0.6), (-0.6, 0.5, 0.7), (0.0, -0.3, 1.2)])
def test_the_sensor_may_be_anywhere(position: tuple[float, float, float]) -> None:
    model = KinematicModel.load("box")
    truth = np.array(IN_VIEW["box"])
    camera = replace(model.camera, pose=look_at(position, [0.1, 0.05, 0.1]), fx=525.0, fy=525.0)
    observation = observe(model, truth, camera, "none", np.random.default_rng(1))
    result = refine(model, observation, perturbed(model, truth, 0.02, 2), SETTINGS)
    np.testing.assert_allclose(result.values, truth, atol=1e-3)


def test_points_removed_with_the_floor_do_not_shorten_a_box() -> None:
    model = KinematicModel.load("box")
    truth = np.array(IN_VIEW["box"])
    whole = seen(model, truth)
    observation = Observation(whole.points[whole.points[:, 2] > 0.03], whole.camera, floor=0.03)
    result = refine(model, observation, perturbed(model, truth, 0.02, 2), SETTINGS)
    np.testing.assert_allclose(result.values, truth, atol=1e-3)


def test_a_handle_that_the_start_has_lost_is_found() -> None:
    """The start is off by more than its size (0.12 x 0.05 m)."""
    model = KinematicModel.load("door")
    truth = np.array([0.6, 0.1, 0.3, -0.3, 0.1, 0.035, -0.08])
    start = truth.copy()
    start[5:] = -0.035, 0.08
    result = refine(model, seen(model, truth), start, SETTINGS)
    np.testing.assert_allclose(result.values, truth, atol=1e-3)


@pytest.mark.parametrize("name", ["box_b", "box_c", "door"])
def test_no_start_is_needed(name: str) -> None:
    model = KinematicModel.load(name)
    truth = np.array(IN_VIEW[name])
    result = refine_from_scratch(model, seen(model, truth), SETTINGS)
    assert result.reason == ""
    np.testing.assert_allclose(result.values, truth, atol=1e-3)


def misfit_of(model: KinematicModel, observation: Observation, values: Vector) -> float:
    """Return the misfit of values that are not refined."""
    return Problem.of(model, observation, SETTINGS).final_misfit(values)


def nonsense(case: str) -> tuple[KinematicModel, Observation, Vector]:
    """Return a model, an observation that it does not fit (or a start that is far off), a start."""
    door, box = KinematicModel.load("door"), KinematicModel.load("box_c")
    truth = np.array(IN_VIEW["door"])
    observation = seen(door, truth)
    points = observation.points
    if case == "start":
        return door, observation, door.limits[:, 1].copy()
    if case == "half":
        half = points[points[:, 1] > np.median(points[:, 1])]
        return door, replace(observation, points=half), truth
    if case == "scattered":
        few = np.random.default_rng(0).permutation(points)[:500]
        return door, replace(observation, points=few), truth
    if case == "box":
        return door, seen(box, np.array(IN_VIEW["box_c"])), np.zeros(7)
    noise = np.random.default_rng(0).uniform(-1.0, 1.0, size=(5000, 3))
    return door, replace(observation, points=noise.astype(np.float32)), np.zeros(7)


@pytest.mark.parametrize("case", ["start", "half", "scattered", "box", "noise"])
def test_the_result_is_never_worse_than_its_start(case: str) -> None:
    """It stays near the limits, and has a reason where nothing fits."""
    model, observation, start = nonsense(case)
    result = refine(model, observation, start, SETTINGS)
    assert np.isfinite(result.values).all()
    assert np.linalg.eigvalsh(result.covariance).min() >= -1e-12
    assert result.iterations < 500
    if result.improved:
        low, high = model.limits.T
        slack = 0.16 * (high - low)
        assert (result.values > low - slack).all()
        assert (result.values < high + slack).all()
        assert result.misfit <= misfit_of(model, observation, start)
    else:
        np.testing.assert_array_equal(result.values, start)
    if case in ("box", "noise", "scattered"):
        assert result.reason


@pytest.mark.parametrize("count", [0, 1, 10])
def test_too_few_points_are_refused_with_a_reason(count: int) -> None:
    model = KinematicModel.load("box_b")
    truth = np.array(IN_VIEW["box_b"])
    whole = seen(model, truth)
    observation = replace(whole, points=whole.points[:count])
    for result in (
        refine(model, observation, truth, SETTINGS),
        refine_from_scratch(model, observation, SETTINGS),
    ):
        assert not result.improved
        assert f"{count} points" in result.reason
        spread = np.sqrt(np.diag(result.covariance))
        np.testing.assert_allclose(spread, np.ptp(model.limits, axis=1) / np.sqrt(12.0))


def test_a_start_that_is_not_finite_is_refused() -> None:
    model = KinematicModel.load("box_b")
    result = refine(model, seen(model, np.zeros(3)), np.array([0.0, np.nan, 0.0]), SETTINGS)
    assert not result.improved
    assert "finite" in result.reason


def test_samples_of_the_evaluation_come_out_exactly() -> None:
    model = KinematicModel.load("box_b")
    errors = []
    for index in range(20):
        observation, truth = sample(model, 11, index, spawn_key=EVALUATION)
        result = refine(model, observation, perturbed(model, truth, 0.02, index), SETTINGS)
        errors.append(np.abs(result.values - truth).sum())
    assert np.mean(errors) < 5e-5


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("damping: 0.01", "damping: -1", "'damping' must be greater than or equal to 0, found -1"),
        ("candidates: ", "places: ", "reacquisition: key 'candidates' is missing"),
        ("window: 32", "window: 3200", r"search\[0\]: 'window' must be less than or equal to 64"),
        ("digits: 6", "digits: 6.5", "misfit: 'digits' must be a whole number, found 6.5"),
    ],
)
def test_wrong_settings_are_refused(tmp_path: Path, old: str, new: str, message: str) -> None:
    content = (resources.share_directory() / "config/refinement.yaml").read_text()
    assert old in content
    file = tmp_path / "mine.yaml"
    file.write_text(content.replace(old, new))
    with pytest.raises(ConfigurationError, match=message):
        RefinementSettings.load(file)


def test_a_search_without_levels_is_refused(tmp_path: Path) -> None:
    content = (resources.share_directory() / "config/refinement.yaml").read_text()
    levels = [line for line in content.splitlines() if line.startswith("  - {window")]
    file = tmp_path / "mine.yaml"
    content = content.replace("\n".join(levels), "  []")
    file.write_text(content)
    with pytest.raises(ConfigurationError, match="'search' .* at least 1 item"):
        RefinementSettings.load(file)
