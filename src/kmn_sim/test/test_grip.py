"""The hand holds things by friction alone."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from kmn_sim.control.trajectory import Command, Waypoint
from kmn_sim.robot.settings import RobotSettings
from kmn_sim.world.simulation import Simulation

Simulate = Callable[..., Simulation]
HALF_SIZE = (0.06, 0.02, 0.025)  # metres; of a lever
MASS = 0.5  # kg
TIPS = ("l_gripper_l_finger_tip_joint", "l_gripper_r_finger_tip_joint")


def move_gripper(simulation: Simulation, angle: float) -> None:
    command = Command((RobotSettings.load().gripper.joint,), [Waypoint(0.5, (angle,))])
    simulation.controllers.accept(command, simulation.time)


def grip(simulation: Simulation, friction: float) -> tuple[int, NDArray[np.float64]]:
    """Close the hand about a lever; return the lever's body and where it was put."""
    physics, robot = simulation.physics, simulation.robot
    move_gripper(simulation, 0.4)
    simulation.run(1.0)
    tips = [physics.getLinkState(robot.body, robot.link(name), 0, 1)[4] for name in TIPS]
    pose = physics.getLinkState(robot.body, robot.link("l_wrist_roll_joint"), 0, 1)[5]
    forward = np.array(physics.getMatrixFromQuaternion(pose)[0::3])
    place = np.mean(tips, axis=0) + 0.02 * forward
    shape = physics.createCollisionShape(physics.GEOM_BOX, halfExtents=HALF_SIZE)
    lever = physics.createMultiBody(MASS, shape, -1, place.tolist(), pose)
    physics.changeDynamics(lever, -1, lateralFriction=friction, spinningFriction=0.02 * friction)
    move_gripper(simulation, 0.0)
    for _ in range(240):
        physics.resetBasePositionAndOrientation(lever, place.tolist(), pose)
        physics.resetBaseVelocity(lever, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
        simulation.step()
    return lever, place


@pytest.mark.parametrize(("friction", "held"), [(1.0, True), (0.0, False)])
def test_a_lever_is_held_as_long_as_there_is_friction(
    simulate: Simulate, friction: float, held: bool
) -> None:
    simulation = simulate(renderer="software")
    lever, place = grip(simulation, friction)
    simulation.run(2.0)
    position = simulation.physics.getBasePositionAndOrientation(lever)[0]
    fallen = place[2] - position[2]
    assert (abs(fallen) < 0.01) if held else (fallen > 0.3)
