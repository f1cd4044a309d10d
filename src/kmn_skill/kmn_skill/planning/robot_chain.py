"""Takes the kinematic chain of a robot from its model in the package robotic."""

from __future__ import annotations

from typing import Any

import numpy as np
import robotic as ry
from numpy.typing import NDArray

from kmn_skill.planning.kinematic_chain import KinematicChain, Link
from kmn_skill.planning.layout import BASE
from kmn_skill.planning.robot import RobotModel
from kmn_skill.planning.robot_frames import add_robot

STEP = 0.5  # m or rad by which a joint is moved to see how
EXACT = 1e-9


def chain_of(robot: RobotModel) -> KinematicChain:
    """Return the chain of a robot's joints, and of those that follow its gripper."""
    configuration = ry.Config()
    configuration.addFrame("world")
    add_robot(configuration, robot)
    configuration.selectJoints(list(robot.model_joints))
    names, parent = robot.joint_names, ""
    links: dict[str, Link] = {}
    for column, name in enumerate(names[BASE]):  # which the model has as one
        moved = _moved(configuration, len(names), column, robot.base.frame, "")
        links[name] = _link(parent, name, *moved, first=not links)
        parent = name
    carriers = {robot.base.frame: parent}
    for name in (*robot.model_joints[1:], *robot.gripper.followers):
        joint = robot.gripper.joint if name in robot.gripper.followers else name
        carrier = _carrier(configuration, name, robot)
        moved = _moved(configuration, len(names), names.index(joint), name, carrier)
        links[name] = _link(carriers.get(carrier, carrier), joint, *moved, first=True)
    return KinematicChain(names, links)


def _carrier(configuration: Any, name: str, robot: RobotModel) -> str:
    """Return the movable joint that carries another one."""
    movable = (*robot.model_joints, *robot.gripper.followers)
    frame = configuration.getFrame(name).getParent()
    while frame.name not in movable:
        frame = frame.getParent()
    return str(frame.name)


def _moved(
    configuration: Any, count: int, column: int, name: str, carrier: str
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return a frame's pose (4, 4) in its carrier, all joints at 0 and one moved by a step."""
    poses = []
    for position in (0.0, STEP):
        positions = np.zeros(count)
        positions[column] = position
        configuration.setJointState(positions)
        pose = configuration.getFrame(name).getTransform()
        if carrier:
            pose = np.linalg.inv(configuration.getFrame(carrier).getTransform()) @ pose
        poses.append(pose)
    return poses[0], poses[1]


def _link(
    parent: str,
    joint: str,
    rest: NDArray[np.float64],
    moved: NDArray[np.float64],
    first: bool,
) -> Link:
    """Return a link from its pose at 0 and after a step; the first of a frame has the offset."""
    motion = np.linalg.inv(rest) @ moved
    offset = rest if first else np.eye(4)
    turn = 0.5 * np.array(
        [motion[2, 1] - motion[1, 2], motion[0, 2] - motion[2, 0], motion[1, 0] - motion[0, 1]]
    )
    sine = float(np.linalg.norm(turn))
    if sine < EXACT:
        return Link(parent, offset, motion[:3, 3] / STEP, True, joint)
    return Link(parent, offset, turn / sine * (np.arcsin(sine) / STEP), False, joint)
