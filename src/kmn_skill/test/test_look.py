"""To see a handle the robot stands before the door, without coming near it, within its limits."""

from __future__ import annotations

import numpy as np
import pytest

from kmn_perception.model.kinematic_model import KinematicModel
from kmn_skill.planning.look import before_door, furthest, look_plan
from kmn_skill.planning.planning_setup import PlanningSetup

SETUP = PlanningSetup.load(KinematicModel.load("door"))
DISTANCE = 1.1  # metres


@pytest.mark.parametrize("seed", range(10))
def test_the_base_ends_before_the_middle_of_the_door_and_faces_it(seed: int) -> None:
    random = np.random.default_rng(seed)
    [values] = SETUP.model.sample(random, 1)
    start = SETUP.robot.home + random.uniform(-0.5, 0.5, len(SETUP.robot.home))
    start[2] += 2.0 * np.pi * random.integers(-1, 2)
    plan = look_plan(SETUP, values, start, before_door(SETUP.model, values, start, DISTANCE), 0.1)
    np.testing.assert_array_equal(plan.positions[0], start)
    x, y, yaw = plan.positions[-1][:3]
    door_x, door_y, door_yaw = values[:3]
    assert np.hypot(x - door_x, y - door_y) == pytest.approx(DISTANCE)
    towards = np.arctan2(door_y - y, door_x - x)
    for angle in (towards, door_yaw):
        assert np.cos(yaw - angle) == pytest.approx(1.0)
    assert abs(yaw - start[2]) <= np.pi
    np.testing.assert_array_equal(
        plan.positions[:, 3:-1], np.tile(start[3:-1], (len(plan.times), 1))
    )
    assert plan.positions[-1, -1] == max(start[-1], 0.5)


@pytest.mark.parametrize("seed", range(10))
def test_velocities_and_accelerations_are_derivatives_within_the_limits(seed: int) -> None:
    random = np.random.default_rng(seed)
    start = SETUP.robot.home + random.uniform(-1.0, 1.0, len(SETUP.robot.home))
    door = SETUP.model.prototype
    plan = look_plan(SETUP, door, start, before_door(SETUP.model, door, start, DISTANCE), 0.1)
    speeds, accelerations = SETUP.robot.limits.T
    steps = np.diff(plan.times)[:, None]
    between = np.diff(plan.positions, axis=0) / steps
    assert (np.abs(between) <= speeds + 1e-9).all()
    assert (np.abs(np.diff(plan.velocities, axis=0) / steps) <= accelerations + 1e-9).all()
    means = (plan.velocities[1:] + plan.velocities[:-1]) / 2.0
    assert np.abs(means - between).max() < 0.02
    assert not plan.velocities[[0, -1]].any()


def test_how_far_links_reach_is_told_in_the_frame_of_the_door() -> None:
    values = np.array([1.0, 2.0, np.pi / 2.0, 0.0, 0.0, 0.0, 0.0])
    links = np.tile(np.eye(4), (2, 1, 1))
    links[:, :3, 3] = [[1.5, 1.5, 1.0], [0.6, 1.7, 0.0]]
    assert furthest(SETUP.model, "panel", values, links) == pytest.approx(-0.3)
    links[1, 0, 3] = 0.2  # beside the door
    assert furthest(SETUP.model, "panel", values, links) == pytest.approx(-0.5)
    links[:, 0, 3] = 9.0
    assert furthest(SETUP.model, "panel", values, links) == -np.inf


def test_the_robot_goes_back_to_where_it_saw_the_door_with_an_open_hand() -> None:
    """Joints that turn on and on take the shorter way."""
    start, there = SETUP.robot.home.copy(), SETUP.robot.home.copy()
    start[:2] += 1.0
    start[-1] = 0.1
    turning = SETUP.robot.joint_names.index("l_wrist_roll_joint")
    there[turning] = start[turning] + 2.0 * np.pi + 0.2
    plan = look_plan(SETUP, SETUP.model.prototype, start, there, 0.1)
    assert plan.positions[-1, turning] == pytest.approx(start[turning] + 0.2)
    assert plan.positions[-1, -1] == 0.5
    others = np.delete(np.arange(len(start)), [turning, len(start) - 1])
    np.testing.assert_array_equal(plan.positions[-1, others], there[others])
