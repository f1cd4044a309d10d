"""Publishes what was perceived for programs that know no morphing parameters."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from geometry_msgs.msg import PoseStamped
from numpy.typing import NDArray
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import JointState
from std_msgs.msg import Header, String
from vision_msgs.msg import Detection3DArray

from kmn_perception.model.object_urdf import object_urdf
from kmn_perception.ros.messages import objects as messages

if TYPE_CHECKING:
    from kmn_perception.estimate import Estimate

QUEUE_DEPTH = 10


class ObjectPublisher:
    """Publishes ``detections``, and of one object its handle and its description with its joints.

    Only objects whose status is OK are published. The one is the first of a frame. Its description
    is latched, and published anew only where the object is another one by more than a distance:
    who shows or plans with it starts anew each time.
    """

    def __init__(self, node: Node) -> None:
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._detections = node.create_publisher(Detection3DArray, "detections", QUEUE_DEPTH)
        self._handle = node.create_publisher(PoseStamped, "handle_pose", QUEUE_DEPTH)
        self._states = node.create_publisher(JointState, "object_joint_states", QUEUE_DEPTH)
        self._description = node.create_publisher(String, "object_description", latched)
        self._described: tuple[str, NDArray[np.float64]] | None = None

    def publish(
        self,
        objects: Sequence[tuple[int, Estimate, NDArray[np.float64]]],
        header: Header,
        max_change: float,
    ) -> None:
        """Publish the objects of a frame that hold.

        Parameters
        ----------
        objects
            For each its number, its estimate and its bodies (B, 4, 4).
        max_change
            Largest distance between bodies and those of the description, metres.
        """
        self._detections.publish(messages.detections_from_estimates(objects, header))
        if not objects:
            return
        _, estimate, _ = objects[0]
        model = estimate.model
        for action in model.actions[:1]:
            self._handle.publish(messages.handle_pose(action, estimate, header))
        closed = estimate.transform @ model.unit_cubes(np.zeros(len(model.theta)), estimate.gamma)
        if self._is_another(model.name + header.frame_id, closed, max_change):
            text = object_urdf(model, estimate.transform, estimate.gamma, header.frame_id)
            self._description.publish(String(data=text))
        if model.joints:
            self._states.publish(messages.joint_states(estimate, header))

    def _is_another(self, name: str, cubes: NDArray[np.float64], max_change: float) -> bool:
        """Tell whether the bodies (B, 4, 4) of the closed object are not those described."""
        before = self._described
        if before is not None and before[0] == name:
            corners = messages.CORNERS @ (cubes - before[1]).transpose(0, 2, 1)
            if np.linalg.norm(corners, axis=2).max() <= max_change:
                return False
        self._described = name, cubes
        return True
