"""Where the published URDF puts the links, against where the physics has them."""

from __future__ import annotations

from collections.abc import Callable
from xml.etree import ElementTree

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from kmn_sim.robot.description import BASE_FOOTPRINT, RobotDescription
from kmn_sim.robot.robot_model import robot_urdf
from kmn_sim.robot.settings import RobotSettings
from kmn_sim.world.simulation import Simulation

pytest.importorskip("robotic")
Simulate = Callable[..., Simulation]
GRIPPER = RobotSettings.load().gripper


@pytest.fixture(scope="module")
def description() -> RobotDescription:
    settings = RobotSettings.load()
    return RobotDescription(robot_urdf(settings), settings)


def test_every_link_is_where_the_physics_has_it(
    simulate: Simulate, description: RobotDescription
) -> None:
    simulation = simulate()
    robot, physics = simulation.robot, simulation.physics
    generator = np.random.default_rng(0)
    links = {
        physics.getJointInfo(robot.body, link)[12].decode(): link
        for link in range(physics.getNumJoints(robot.body))
    }
    for _ in range(5):
        positions = {
            name: generator.uniform(max(low, -3.0), min(high, 3.0))
            for name, (low, high) in robot.limits.items()
        }
        led = dict.fromkeys(GRIPPER.followers, positions[GRIPPER.joint])
        for name, position in {**positions, **led}.items():
            physics.resetJointState(robot.body, robot.link(name), position)
        poses = {BASE_FOOTPRINT: robot.base_pose()}
        moved = zip(description.moved, description.poses(positions), strict=True)
        placed = [*description.fixed, *((*links, pose) for links, pose in moved)]
        for parent, child, pose in placed:
            poses[child] = poses[parent] @ pose
            place, turn = physics.getLinkState(robot.body, links[child], 0, 1)[4:6]
            np.testing.assert_allclose(poses[child][:3, 3], place, atol=1e-6)
            np.testing.assert_allclose(
                poses[child][:3, :3], Rotation.from_quat(turn).as_matrix(), atol=1e-6
            )
        assert set(links) - set(poses) == {"base_x_link", "base_y_link"}


def test_it_is_a_robot_as_others_know_them(description: RobotDescription) -> None:
    """One tree below the footprint; joints that nobody commands mimic one that is commanded."""
    robot, settings = ElementTree.fromstring(description.text), RobotSettings.load()
    children = {joint.find("child").get("link") for joint in robot.iter("joint")}  # type: ignore[union-attr]
    assert {link.get("name") for link in robot.iter("link")} - children == {BASE_FOOTPRINT}
    mimics = {
        joint.get("name"): mimic.get("joint")
        for joint in robot.iter("joint")
        for mimic in joint.iter("mimic")
    }
    assert mimics == dict.fromkeys(settings.gripper.followers, settings.gripper.joint)
    moved = {joint.get("name") for joint in robot.iter("joint") if joint.get("type") != "fixed"}
    assert moved - set(mimics) == set(settings.names) - set(settings.base_names)
