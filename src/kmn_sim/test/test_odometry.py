"""Odometry that drifts: the robot believes it, and stands elsewhere."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from kmn_sim.control.trajectory import Command, Waypoint
from kmn_sim.robot.odometry import Odometry
from kmn_sim.world.simulation import Simulation

Simulate = Callable[..., Simulation]


def test_the_error_is_in_proportion_to_the_way_and_turns_with_it() -> None:
    for direction in np.deg2rad([0.0, 70.0, 200.0]):
        ahead = np.array([np.cos(direction), np.sin(direction)])
        left = np.array([-ahead[1], ahead[0]])
        odometry = Odometry(np.array([1.0, 2.0]), 0.02)
        for way in np.linspace(0.0, 3.0, 7):
            place = np.array([1.0, 2.0]) + way * ahead
            error = odometry.place(place) - place
            np.testing.assert_allclose(
                error, 0.02 * way * (ahead + left) / np.sqrt(2.0), atol=1e-12
            )
            np.testing.assert_allclose(odometry.place(place) - place, error)  # nothing moved


@pytest.mark.parametrize("drift", [0.0, 0.02])
def test_the_robot_goes_where_its_odometry_is_told_to(simulate: Simulate, drift: float) -> None:
    simulation = simulate(odometry_drift=drift)
    start = simulation.robot.base_pose()[:2, 3]
    command = Command(("base_y",), [Waypoint(2.0, (1.0,), (0.0,))])
    simulation.controllers.accept(command, simulation.time)
    simulation.run(3.0)
    robot = simulation.robot
    np.testing.assert_allclose(robot.odometry_pose()[:2, 3], start + [0.0, 1.0], atol=2e-3)
    np.testing.assert_allclose(robot.state().positions[:2], robot.odometry_pose()[:2, 3])
    driven = robot.base_pose()[:2, 3] - start
    off = np.hypot(*(driven - [0.0, 1.0]))
    assert off == pytest.approx(drift, rel=0.1, abs=2e-3)
