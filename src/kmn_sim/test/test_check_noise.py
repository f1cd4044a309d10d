"""The simulated Kinect against real frames of the same scenes, and against geometry."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from kmn_perception.model.camera import Camera
from kmn_perception.model.depth_sensor import DepthSensor
from kmn_perception.model.noisy_sensor import NoisySensor
from kmn_sim.checks.check_noise import compare
from kmn_sim.checks.noise_statistics import inverse_step, missing_runs, plane_noise

FX = Camera.load("kinect_v1").fx


def kinect(seed: int = 0) -> NoisySensor:
    return NoisySensor(DepthSensor.load("kinect_v1"), seed)


def plane(distance: float) -> NDArray[np.float32]:
    """Return the depth image of a plane that faces the camera."""
    return np.full((120, 160), distance, dtype=np.float32)


@pytest.fixture(scope="module")
def comparison() -> dict[str, dict[str, float]]:
    return compare(17, seed=0)


def test_noise_and_steps_are_those_of_real_frames(
    comparison: dict[str, dict[str, float]],
) -> None:
    real, simulated = comparison["real"], comparison["simulated"]
    names = [name for name in real if name.startswith(("noise", "step"))]
    assert len(names) == 5
    for name in names:
        assert simulated[name] == pytest.approx(real[name], rel=0.15), name


def test_as_much_is_missing_beside_boxes_as_in_real_frames(
    comparison: dict[str, dict[str, float]],
) -> None:
    real, simulated = comparison["real"], comparison["simulated"]
    names = [name for name in real if name.startswith("missing")]
    assert len(names) == 6
    for name in names:
        assert simulated[name] == pytest.approx(real[name], abs=1.0), name


def test_shadows_are_as_wide_as_the_parallax_of_projector_and_infrared_camera() -> None:
    depth = plane(1.2)
    depth[40:80, 60:100] = 0.6
    missing = np.zeros(depth.shape)
    for seed in range(20):
        missing += np.isnan(kinect(seed).measure(depth, FX)) / 20
    beside = missing[45:75].mean(axis=0)
    left, right = (FX * baseline * (1 / 0.6 - 1 / 1.2) for baseline in (0.05, 0.025))
    assert beside[: 60 - int(left) - 2].max() < 0.05
    assert beside[60 - int(left) + 4 : 57].min() > 0.95
    assert beside[103 : 100 + int(right) - 4].min() > 0.95
    assert beside[100 + int(right) + 2 :].max() < 0.05


def test_the_same_seed_gives_the_same_noise() -> None:
    first, again, other = (kinect(seed).measure(plane(1.0), FX) for seed in (1, 1, 2))
    np.testing.assert_array_equal(first, again)
    assert (first != other).any()


def test_noise_about_a_tilted_plane_is_measured_without_the_tilt() -> None:
    rows = np.arange(60.0)[:, None] + np.zeros((1, 80))
    exact = 1.0 / (1.0 + 2e-3 * rows)
    noisy = exact + np.random.default_rng(0).normal(scale=2e-3, size=exact.shape)
    means, deviations = plane_noise(noisy.astype(np.float32), np.ones(exact.shape, dtype=bool), 15)
    assert len(means) == 15
    assert deviations.mean() == pytest.approx(2e-3, rel=0.05)
    assert means.min() > exact.min() and means.max() < exact.max()


def test_missing_runs_are_counted_beside_the_object_alone() -> None:
    depth = plane(1.0)
    box = np.zeros(depth.shape, dtype=bool)
    box[10:20, 50:80] = True
    depth[10:20, 45:50] = np.nan
    depth[10:15, 80:] = np.nan  # these runs end nowhere
    assert missing_runs(depth, box, ~box, -1, 10).tolist() == [-1] * 10 + [5] * 10 + [-1] * 100
    assert missing_runs(depth, box, ~box, 1, 10).tolist() == [-1] * 15 + [0] * 5 + [-1] * 100


def test_steps_of_depth_are_found() -> None:
    depth = 1.0 / np.arange(0.8, 1.2, 0.0029)
    assert inverse_step(depth.astype(np.float32), 0.9, 1.1) == pytest.approx(0.0029, rel=1e-3)
