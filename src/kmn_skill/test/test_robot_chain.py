"""The kinematic chain moves as the robot's model does in the package robotic."""

from __future__ import annotations

import numpy as np
import pytest
import robotic as ry

from kmn_skill.planning.kinematic_chain import KinematicChain
from kmn_skill.planning.robot import RobotModel
from kmn_skill.planning.robot_chain import chain_of


@pytest.fixture(scope="module")
def robot() -> RobotModel:
    return RobotModel.load("pr2")


@pytest.fixture(scope="module")
def chain(robot: RobotModel) -> KinematicChain:
    return chain_of(robot)


@pytest.mark.parametrize("seed", range(10))
def test_every_link_is_where_the_model_has_it(
    robot: RobotModel, chain: KinematicChain, seed: int
) -> None:
    model = ry.Config()
    model.addFile(ry.raiPath(robot.source))
    model.selectJoints(list(robot.model_joints))
    positions = np.random.default_rng(seed).uniform(-3.0, 3.0, len(robot.joint_names))
    positions[-1] = abs(positions[-1]) / 6.0  # the gripper's
    model.setJointState(positions)
    poses = chain.poses(positions)
    for name in (*robot.model_joints, *robot.gripper.followers):
        link = "base_yaw" if name == robot.base.frame else name
        assert poses[link] == pytest.approx(model.getFrame(name).getTransform(), abs=1e-9)


def test_all_joints_move_it_and_links_stand_after_those_that_carry_them(
    robot: RobotModel, chain: KinematicChain
) -> None:
    assert {link.joint for link in chain.links.values()} == set(robot.joint_names)
    before = {""}
    for name, link in chain.links.items():
        assert link.parent in before
        before.add(name)
