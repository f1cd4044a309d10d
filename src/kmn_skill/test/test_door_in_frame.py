"""A door in another frame: the same door, as certain as before; only on the same ground."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from kmn_perception.model.kinematic_model import KinematicModel
from kmn_skill.execution.door_in_frame import FrameSettings, door_in_frame
from kmn_skill.execution.door_observation import DoorObservation
from kmn_skill.execution.errors import DoorError

MODEL = KinematicModel.load("room_door")
NAMES = tuple(parameter.name for parameter in MODEL.parameters)
SETTINGS = FrameSettings.load()
VALUES = np.array([0.1, -0.2, 0.3, 0.05, -0.1, 0.01, 0.02])
SPREAD = np.diag([0.01, 0.003, 0.02, 0.01, 0.01, 0.01, 0.01]) + 0.001
SEEN = DoorObservation(1.0, "room_door", "plane", NAMES, VALUES, SPREAD @ SPREAD.T, "")


def pose(x: float, y: float, yaw: float, z: float = 0.0, pitch: float = 0.0) -> np.ndarray:
    made = np.eye(4)
    made[:3, :3] = Rotation.from_euler("ZY", [yaw, pitch]).as_matrix()
    made[:3, 3] = x, y, z
    return made


@given(st.floats(-5.0, 5.0), st.floats(-5.0, 5.0), st.floats(-3.1, 3.1))
def test_it_stands_at_the_same_place(x: float, y: float, yaw: float) -> None:
    moved = door_in_frame(MODEL, SEEN, "odom", pose(x, y, yaw), SETTINGS)
    assert moved.frame == "odom"
    theta, gamma = MODEL.split(SEEN.values)
    expected = pose(x, y, yaw) @ MODEL.unit_cubes(theta, gamma)
    found = MODEL.unit_cubes(*MODEL.split(moved.values))
    np.testing.assert_allclose(found, expected, atol=1e-9)


def test_its_covariance_is_that_of_doors_that_are_moved_one_by_one() -> None:
    there = pose(1.0, -2.0, 1.2)
    moved = door_in_frame(MODEL, SEEN, "odom", there, SETTINGS)
    random = np.random.default_rng(0)
    doors = random.multivariate_normal(VALUES, SEEN.covariance, 4000)
    values = [
        door_in_frame(MODEL, SEEN._replace(values=door), "odom", there, SETTINGS).values
        for door in doors
    ]
    np.testing.assert_allclose(moved.covariance, np.cov(np.array(values).T), atol=2e-5)
    back = door_in_frame(MODEL, moved, "plane", np.linalg.inv(there), SETTINGS)
    np.testing.assert_allclose(back.values, VALUES, atol=1e-9)
    np.testing.assert_allclose(back.covariance, SEEN.covariance, atol=1e-9)


@pytest.mark.parametrize("there", [pose(0.0, 0.0, 0.0, 0.1), pose(0.0, 0.0, 0.0, 0.0, 0.06)])
def test_another_ground_is_refused(there: np.ndarray) -> None:
    with pytest.raises(DoorError, match="the ground of 'plane' is tilted by"):
        door_in_frame(MODEL, SEEN, "odom", there, SETTINGS)
    rough = replace(SETTINGS, max_tilt=0.1, max_height=0.2)
    assert door_in_frame(MODEL, SEEN, "odom", there, rough).frame == "odom"


def test_what_is_no_door_of_the_model_is_left_to_others() -> None:
    short = SEEN._replace(values=VALUES[:2])
    assert door_in_frame(MODEL, short, "odom", pose(1.0, 0.0, 0.0), SETTINGS) == short._replace(
        frame="odom"
    )
