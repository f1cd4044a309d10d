"""A client of sim_node: it commands, and keeps what is published."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import CameraInfo, Image, JointState, PointCloud2
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from graph import GraphClient
from kmn_msgs.msg import MorphingParameters
from kmn_perception.ros.stamps import duration_of, seconds

ARM = ["l_shoulder_pan_joint", "l_elbow_flex_joint"]
STILL = 0.02  # m/s and rad/s


def trajectory(*points: tuple[float, ...], names: Sequence[str] = ARM) -> JointTrajectory:
    """Return a trajectory of points (time, positions)."""
    made = [JointTrajectoryPoint(positions=p, time_from_start=duration_of(t)) for t, *p in points]
    return JointTrajectory(joint_names=list(names), points=made)


def time_to_rest(states: Sequence[JointState], since: float) -> float:
    """Return how long after a time (s) the joints that are told moved for the last time."""
    moved = [seconds(s.header.stamp) for s in states if np.abs(s.velocity).max() > STILL]
    return max(moved) - since


class SimClient(GraphClient):
    """Commands sim_node and keeps what it publishes."""

    def __init__(self, graph: Any) -> None:
        super().__init__(graph, "sim_node")
        self.joints: list[JointState] = []
        self.doors: list[JointState] = []
        self.truths: list[MorphingParameters] = []
        self.images: list[Image] = []
        self.infos: list[CameraInfo] = []
        self.clouds: list[PointCloud2] = []
        self.clocks: list[Clock] = []
        for kind, name, kept in (
            (JointState, "joint_states", self.joints),
            (JointState, "door_state", self.doors),
            (MorphingParameters, "ground_truth", self.truths),
            (Clock, "/clock", self.clocks),
        ):
            self.create_subscription(kind, name, kept.append, 100)
        self.trajectory = self.create_publisher(JointTrajectory, "joint_trajectory", 10)
        self.reset = self.create_client(Trigger, "reset")

    def now(self) -> float:
        """Return the simulated time, seconds."""
        self.clocks.clear()
        return seconds(self.graph.wait_for(lambda: self.clocks)[-1].clock)

    def wait_until(self, time: float) -> None:
        """Wait until a simulated time, seconds, is over."""
        self.graph.wait_for(lambda: self.now() > time)

    def position(self, joint: str) -> float:
        state = self.joints[-1]
        return float(state.position[list(state.name).index(joint)])

    def wait_until_at(self, joint: str, position: float) -> None:
        self.graph.wait_for(lambda: abs(self.position(joint) - position) < 0.01)
