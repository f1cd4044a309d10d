"""A camera on a robot that moves about a table with boxes, and the transforms of both."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from geometry_msgs.msg import TransformStamped
from numpy.typing import NDArray
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Header
from tf2_msgs.msg import TFMessage

from kmn_perception.model.camera import Camera, look_at
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.model.rendering import depth_to_points, render
from kmn_perception.ros.messages import cloud_from_points, transform_message
from kmn_perception.ros.stamps import stamp_of

MODEL = KinematicModel.load("box")
CAMERA = Camera.load("kinect_v1").resized(320, 240)
ON_BASE = look_at([0.0, 0.0, 0.9], [0.8, 0.0, 0.0])  # of the camera
BOXES = ([0.0, -0.15, 0.2, 0.1, -0.2, 0.0], [0.05, 0.2, -0.3, -0.3, 0.1, -0.3])  # theta
TABLE = np.diag([3.0, 3.0, 0.02, 1.0])
TABLE[2, 3] = -0.01
FRAME = "camera"


def pose_2d(x: float, y: float, yaw: float) -> NDArray[np.float64]:
    """Return the pose (4, 4) of a base on the ground."""
    pose = np.eye(4)
    pose[:2, :2] = [[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]]
    pose[:2, 3] = x, y
    return pose


def base_at(time: float) -> NDArray[np.float64]:
    """Return where the base is at a time (s): it drives and turns, and begins anew each 20 s."""
    driven = time % 20.0
    return pose_2d(-0.8 + 0.1 * driven, 0.1 * driven, -0.12 * driven)


def seen_from(base: NDArray[np.float64], time: float, frame: str = FRAME) -> PointCloud2:
    """Return what the camera sees at a time (s)."""
    pose = base @ ON_BASE
    cubes = [MODEL.unit_cubes(theta, np.empty(0)) for theta in BOXES]
    camera = Camera(**{**vars(CAMERA), "pose": pose})
    depth = render(np.concatenate([*cubes, TABLE[None]]), camera)
    header = Header(frame_id=frame, stamp=stamp_of(time))
    return cloud_from_points(depth_to_points(depth, camera), header)


def told(parent: str, child: str, time: float, pose: NDArray[np.float64]) -> TransformStamped:
    return transform_message(Header(frame_id=parent, stamp=stamp_of(time)), child, pose)


class Broadcaster:
    """Publishes transforms from a client's node; moving ones once they are listened to."""

    def __init__(self, client: Any) -> None:
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._moving = client.create_publisher(TFMessage, "/tf", 100)
        self._fixed = client.create_publisher(TFMessage, "/tf_static", latched)
        client.graph.wait_for(self._fixed.get_subscription_count)
        self._wait = client.graph.wait_for

    def fix(self, *transforms: TransformStamped) -> None:
        self._fixed.publish(TFMessage(transforms=list(transforms)))
        self._fixed.wait_for_all_acked()

    def move(self, *transforms: TransformStamped) -> None:
        self._wait(self._moving.get_subscription_count)
        self._moving.publish(TFMessage(transforms=list(transforms)))
        self._moving.wait_for_all_acked()

    def drive(self, times: Sequence[float]) -> None:
        """Tell where the base is at some times (s)."""
        self.move(*(told("world", "base", time, base_at(time)) for time in times))
