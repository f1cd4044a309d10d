"""Where everything is: ``/tf``, ``/tf_static`` and ``robot_description``.

world - odom - base_footprint - links of the robot, and world or base_footprint - camera_link -
optical frame of the camera.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import TransformStamped
from numpy.typing import NDArray
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import Header, String
from tf2_msgs.msg import TFMessage

from kmn_perception.model.rotation import quaternion_from_matrix
from kmn_perception.ros.messages.transforms import set_transform, transform_message
from kmn_sim.robot.description import BASE_FOOTPRINT, Placed, RobotDescription
from kmn_sim.ros.sim_node_parameters import CAMERA_LINK, ODOM, SimNodeSettings
from kmn_sim.world.simulation import Simulation

QUEUE_DEPTH = 100
OPTICAL = np.array(  # an optical frame (x right, y down) in a body frame (x forward, y left)
    [[0.0, 0.0, 1.0, 0.0], [-1.0, 0.0, 0.0, 0.0], [0.0, -1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]]
)


class TransformPublisher:
    """Publishes the robot's description once, and transforms as often as it is asked to."""

    def __init__(self, node: Node, description: RobotDescription) -> None:
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._description = description
        links = [(ODOM, BASE_FOOTPRINT), *description.moved]
        # Made once and changed from then on: to make it costs a millisecond.
        self._moving = TFMessage(
            transforms=[
                TransformStamped(header=Header(frame_id=parent), child_frame_id=child)
                for parent, child in links
            ]
        )
        self._moving_publisher = node.create_publisher(TFMessage, "/tf", QUEUE_DEPTH)
        self._fixed_publisher = node.create_publisher(TFMessage, "/tf_static", latched)
        self._told: tuple[SimNodeSettings, float] | None = None  # what rests, as last published
        self._text_publisher = node.create_publisher(String, "robot_description", latched)
        self._text_publisher.publish(String(data=description.text))

    def publish(self, simulation: Simulation, settings: SimNodeSettings, stamp: Time) -> None:
        """Publish where everything is; what rests only if it is elsewhere than it was."""
        if self._told != (settings, simulation.floor):
            self._told = settings, simulation.floor
            self._fixed_publisher.publish(_message(self._resting(simulation, settings), stamp))
        if not self._moving_publisher.get_subscription_count():
            return
        robot = simulation.robot
        base = robot.odometry_pose()
        positions = dict(zip(robot.limits, robot.state().positions.tolist(), strict=True))
        poses = np.concatenate([base[None], self._description.poses(positions)])
        turns = quaternion_from_matrix(poses[:, :3, :3])
        for message, place, turn in zip(
            self._moving.transforms, poses[:, :3, 3].tolist(), turns.tolist(), strict=True
        ):
            message.header.stamp = stamp
            set_transform(message, place, turn)
        self._moving_publisher.publish(self._moving)

    def _resting(self, simulation: Simulation, settings: SimNodeSettings) -> list[Placed]:
        world = settings["world_frame"]
        mount = world if settings["camera_mount"] == "world" else BASE_FOOTPRINT
        return [
            Placed(world, ODOM, _odometry_origin(simulation)),
            *self._description.fixed,
            Placed(mount, CAMERA_LINK, settings.camera.pose @ OPTICAL.T),
            Placed(CAMERA_LINK, settings["camera_frame"], OPTICAL),
        ]


def _odometry_origin(simulation: Simulation) -> NDArray[np.float64]:
    """Return the pose (4, 4) of the odometry frame in the world: on the floor."""
    pose = np.eye(4)
    pose[2, 3] = simulation.floor
    return pose


def _message(placed: Sequence[Placed], stamp: Time) -> TFMessage:
    headers = [Header(stamp=stamp, frame_id=each.parent) for each in placed]
    return TFMessage(
        transforms=[
            transform_message(header, each.child, each.pose)
            for header, each in zip(headers, placed, strict=True)
        ]
    )
