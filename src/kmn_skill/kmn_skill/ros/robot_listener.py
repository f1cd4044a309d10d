"""Listens to a running robot, and sees who serves and hears what."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Any, Generic, NamedTuple, TypeVar

import rclpy
from nav_msgs.msg import Odometry
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile, qos_profile_sensor_data
from sensor_msgs.msg import CameraInfo, JointState
from std_msgs.msg import String

from kmn_msgs.msg import MorphingParameters
from kmn_perception.ros.reports import ThrottledWarnings
from kmn_perception.ros.stamps import NANOSECONDS, seconds
from kmn_perception.ros.transforms import TransformListener
from kmn_perception.transforms.transform import TransformError

TURN = 0.05  # seconds
NOWHERE = ("no", "frame")
Message = TypeVar("Message")


class Received(NamedTuple, Generic[Message]):
    """The messages of a topic, and how old each was by its stamp, seconds."""

    messages: list[Message]
    ages: list[float]

    def clear(self) -> None:
        """Forget all."""
        self.messages.clear()
        self.ages.clear()

    def rate(self) -> float:
        """Return how many there are a second, by their stamps."""
        stamps = [seconds(message.header.stamp) for message in self.messages]  # type: ignore[attr-defined]
        span = stamps[-1] - stamps[0]
        return (len(stamps) - 1) / span if span > 0.0 else 0.0


class RobotListener:
    """Keeps what a robot tells.

    Parameters
    ----------
    node
        In the robot's namespace; it takes simulated time where that is published.

    Attributes
    ----------
    joints, odometry, cameras, doors, description
        What came on the topics.
    """

    def __init__(self, node: Node) -> None:
        self._node = node
        self.joints: Received[JointState] = Received([], [])
        self.odometry: Received[Odometry] = Received([], [])
        self.cameras: Received[CameraInfo] = Received([], [])
        self.doors: Received[MorphingParameters] = Received([], [])
        self.description: list[String] = []
        self._transforms = TransformListener(node, ThrottledWarnings(node))

    def listen(self, discovery: float, duration: float) -> None:
        """Find out within some seconds who is there, and listen for some more."""
        self._spin(discovery, self._time_is_simulated)
        self._subscribe()
        simulated = False
        while not simulated:
            simulated = self._time_is_simulated()
            if simulated:
                self._node.set_parameters([Parameter("use_sim_time", value=True)])
                self._spin(duration, lambda: self._node.get_clock().now().nanoseconds > 0)
            for received in (self.joints, self.odometry, self.cameras, self.doors):
                received.clear()
            self._spin(duration)
            if not self._time_is_simulated():
                return  # else it was found late, on a busy machine, and ages are of another clock

    def _time_is_simulated(self) -> bool:
        return self._node.count_publishers("/clock") > 0

    def _subscribe(self) -> None:
        sensor = qos_profile_sensor_data
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        for kind, topic, received in (
            (JointState, "joint_states", self.joints),
            (Odometry, "odom", self.odometry),
            (CameraInfo, "depth/camera_info", self.cameras),
            (MorphingParameters, "morphing_parameters", self.doors),
        ):
            self._node.create_subscription(kind, topic, self._keeping(received), sensor)
        self._node.create_subscription(
            String, "robot_description", self.description.append, latched
        )
        self._transforms.listen(True)
        self._find(*NOWHERE)  # a look-up that fails lets it listen to what moves, too

    def missing_transform(self, target: str, source: str, max_age: float) -> str:
        """Return why it is not known where a frame (``source``) was of late; empty if it is."""
        age = int(max_age * NANOSECONDS)
        return self._find(target, source, self._node.get_clock().now().nanoseconds - age)

    def listeners(self, topic: str) -> int:
        """Return how many subscribe to a topic."""
        return self._node.count_subscribers(self._node.resolve_topic_name(topic))

    def talkers(self, topic: str) -> int:
        """Return how many publish on a topic."""
        return self._node.count_publishers(self._node.resolve_topic_name(topic))

    def types(self, topic: str) -> Sequence[str]:
        """Return the types, as package/msg/Name, that a topic has."""
        name = self._node.resolve_topic_name(topic)
        return dict(self._node.get_topic_names_and_types()).get(name, [])

    def action_types(self, action: str) -> list[str]:
        """Return the types, as package/action/Name, that are served under an action's name."""
        name = f"{self._node.resolve_service_name(action)}/_action/send_goal"
        served = dict(self._node.get_service_names_and_types()).get(name, [])
        return [kind.removesuffix("_SendGoal") for kind in served]

    def _find(self, target: str, source: str, stamp: int = 0) -> str:
        try:
            self._transforms.lookup(target, source, stamp)
        except TransformError as error:
            return str(error)
        return ""

    def _keeping(self, received: Received[Any]) -> Any:
        def keep(message: Any) -> None:
            now = self._node.get_clock().now().nanoseconds / NANOSECONDS
            received.messages.append(message)
            received.ages.append(now - seconds(message.header.stamp))

        return keep

    def _spin(self, duration: float, is_enough: Callable[[], bool] = lambda: False) -> None:
        end = time.monotonic() + duration
        while time.monotonic() < end and not is_enough():
            rclpy.spin_once(self._node, timeout_sec=TURN)
