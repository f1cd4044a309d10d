"""Makes what moves the robot, as a parameter and the robot's file say."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from rclpy.node import Node

from kmn_perception.configuration.node_parameters import ParameterError
from kmn_perception.configuration.robot_parts import velocity_controller
from kmn_skill.execution.base_motion import BaseOdometry
from kmn_skill.planning.layout import BASE
from kmn_skill.planning.robot import RobotModel
from kmn_skill.ros.action_control import ActionControl
from kmn_skill.ros.skill_node_parameters import TOPIC, SkillNodeSettings
from kmn_skill.ros.topic_control import TopicControl
from kmn_skill.ros.velocity_control import VelocityControl


def make_control(
    node: Node,
    robot: RobotModel,
    odometry: BaseOdometry,
    settings: Callable[[], SkillNodeSettings],
    now: Callable[[], float],
) -> TopicControl | ActionControl:
    """Return what moves a robot.

    Parameters
    ----------
    odometry
        Of a base that takes velocities.
    settings
        Returns those of skill_node.
    now
        Returns the time of the node's clock, seconds.

    Raises
    ------
    ParameterError
        If the robot cannot be controlled so.
    """
    name, control = velocity_controller(robot.controllers), settings().control
    if control == TOPIC and name:
        raise ParameterError(
            f"'control' must be action for a robot whose base takes velocities, found '{control}'"
        )
    if control == TOPIC:
        return TopicControl(node, robot)
    base = None
    if name:
        speeds = np.array([joint.velocity for joint in robot.joints.values()])[BASE]
        base = VelocityControl(
            node,
            robot.controllers[name],
            speeds,
            odometry,
            settings().base_rate,
            lambda: settings().tracking,
            now,
        )
    return ActionControl(node, robot, now, lambda: settings().controller_timeout, base)
