"""The training's observations: what real sensors do to them."""

from dataclasses import replace

import numpy as np
import pytest

from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.model.surface_distance import surface_distances
from kmn_perception.training.procedures import load_training_settings
from kmn_perception.training.samples import sample
from kmn_perception.training.settings import SensorSettings

BOX = KinematicModel.load("box")


@pytest.fixture
def exact() -> SensorSettings:
    """Return the shipped sensor without anything that it gets wrong."""
    sensor = load_training_settings("box").sensor
    assert sensor is not None
    return replace(
        sensor, noise="none", holes=0.0, pose_error=(0.0, 0.0), occlusion=0.0, cut_height=0.0
    )


def distances(sensor: SensorSettings, index: int) -> np.ndarray:
    observation, values = sample(BOX, 3, index, sensor)
    return surface_distances(BOX.unit_cubes(*BOX.split(values)), observation.points)


def test_an_exact_sensor_sees_the_surface_from_around(exact: SensorSettings) -> None:
    places = []
    for index in range(20):
        assert distances(exact, index).max() < 1e-4
        observation, values = sample(BOX, 3, index, exact)
        places.append(observation.camera.pose[:3, 3] - [*values[:2], 0.1 * (1.0 + values[5])])
    away = np.linalg.norm(places, axis=1)
    low, high = exact.distance
    assert low - 1e-6 <= away.min() < away.max() <= high + 1e-6


def test_holes_lose_points_inside(exact: SensorSettings) -> None:
    for index in range(10):
        whole, _ = sample(BOX, 3, index, exact)
        holed, _ = sample(BOX, 3, index, replace(exact, holes=1.0))
        assert 0 < len(holed.points) < len(whole.points)


def test_a_wrong_pose_moves_points_and_camera_together(exact: SensorSettings) -> None:
    errors, moves = [], []
    for index in range(40):
        true, _ = sample(BOX, 3, index, exact)
        wrong, values = sample(BOX, 3, index, replace(exact, pose_error=(0.01, 0.0)))
        there, here = true.camera.pose, wrong.camera.pose
        np.testing.assert_allclose(here[:3, :3] @ here[:3, :3].T, np.eye(3), atol=1e-9)
        moves.append(here[:3, 3] - there[:3, 3])
        # All points have moved as the camera did.
        cubes = BOX.unit_cubes(*BOX.split(values))
        errors.append(surface_distances(cubes, wrong.points - moves[-1].astype(np.float32)).max())
    assert np.std(moves) == pytest.approx(0.01, rel=0.3)
    assert max(errors) < 1e-4


def test_points_near_the_floor_are_lost(exact: SensorSettings) -> None:
    floors = []
    for index in range(20):
        observation, _ = sample(BOX, 3, index, replace(exact, cut_height=0.012))
        assert observation.points[:, 2].min() > observation.floor
        floors.append(observation.floor)
    assert 0.0 < min(floors) < max(floors) < 0.012


@pytest.mark.parametrize("name", ["robust/door", "box"])
def test_robust_settings_train_with_all_that_sensors_get_wrong(name: str) -> None:
    sensor = load_training_settings(name).sensor
    assert sensor is not None
    assert sensor.noise == "kinect"
    assert min(sensor.holes, sensor.occlusion, *sensor.pose_error) > 0.0
