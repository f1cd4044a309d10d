"""Moves the robot by a topic of all its joints."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from rclpy.node import Node
from trajectory_msgs.msg import JointTrajectory

from kmn_skill.execution.plan_execution import Part
from kmn_skill.planning.robot import RobotModel
from kmn_skill.ros import messages

QUEUE_DEPTH = 10
TOPIC = "joint_trajectory"


class TopicControl:
    """Publishes trajectories; whether they are followed the states of the robot tell."""

    def __init__(self, node: Node, robot: RobotModel) -> None:
        self._names = robot.told_names
        self._columns = [robot.joint_names.index(name) for name in self._names]
        self._publisher = node.create_publisher(JointTrajectory, TOPIC, QUEUE_DEPTH)

    def send(self, part: Part) -> None:
        """Publish a part of a plan."""
        self._publisher.publish(messages.trajectory_from_part(part.of(self._columns), self._names))

    def hold(self, positions: NDArray[np.float64], duration: float) -> None:
        """Let the robot come to rest at positions (J,), m and rad, within some seconds."""
        told = positions[self._columns]
        self._publisher.publish(messages.hold_trajectory(told, self._names, duration))

    def are_through(self) -> bool:
        """Return True: a topic does not answer."""
        return True

    def destroy(self) -> None:
        """Do nothing: publishers end with their node."""
