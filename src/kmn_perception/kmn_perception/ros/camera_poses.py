"""Where the camera of a frame is: taken from the transforms, or told by one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from diagnostic_msgs.msg import DiagnosticStatus
from numpy.typing import NDArray
from rclpy.node import Node
from rclpy.publisher import Publisher
from std_msgs.msg import Header
from tf2_msgs.msg import TFMessage

from kmn_perception.ros.messages import MessageError, transform_message
from kmn_perception.ros.morph_node_parameters import MorphNodeSettings
from kmn_perception.ros.overridable_node import overridden
from kmn_perception.ros.reports import ThrottledWarnings
from kmn_perception.ros.transforms import TransformListener
from kmn_perception.scene.camera_pose import CameraPose
from kmn_perception.scene.depth_view import DepthView
from kmn_perception.transforms.transform import TransformError

QUEUE_DEPTH = 100


class CameraPoses:
    """The transforms that a node needs, and that which it publishes.

    Parameters
    ----------
    node, warnings
        Whose they are, and where to tell what is wrong with them.
    """

    def __init__(self, node: Node, warnings: ThrottledWarnings) -> None:
        self._node, self._warnings = node, warnings
        self._listener = TransformListener(node, warnings)
        self._profile = overridden(node, Publisher, "/tf", QUEUE_DEPTH)
        self._publisher: Publisher | None = None  # none where it would not be used: see `auto`

    def configure(self, settings: MorphNodeSettings) -> None:
        """Listen and publish as the settings need it."""
        source = settings.pipeline.camera_pose
        self._listener.listen(source in (CameraPose.AUTO, CameraPose.TF))
        if source is CameraPose.SUPPORT_PLANE and self._publisher is None:
            self._publisher = self._node.create_publisher(TFMessage, "/tf", self._profile)
        elif source is not CameraPose.SUPPORT_PLANE and self._publisher is not None:
            self._node.destroy_publisher(self._publisher)
            self._publisher = None

    def add_to(self, view: DepthView, settings: MorphNodeSettings, patience: float) -> DepthView:
        """Return a view with the pose of its camera, if that is to come from transforms.

        Parameters
        ----------
        patience
            Seconds to wait for transforms that are not there yet.

        Raises
        ------
        MessageError
            If it is not known.
        """
        source = settings.pipeline.camera_pose
        if view.in_world or source not in (CameraPose.AUTO, CameraPose.TF):
            return view
        if source is CameraPose.AUTO and not self._listener.anyone_tells(patience > 0.0):
            return view
        world, frame = settings.world_frame, view.frame.lstrip("/")
        try:
            pose = self._listener.lookup(world, frame, view.stamp, max(patience, 0.0))
        except TransformError as error:
            raise MessageError(
                f"transform_{error.reason}",
                f"the camera's pose is not known, no transform from '{world}' to '{frame}' at the "
                f"stamp of the frame: {error}",
            ) from error
        return replace(view, pose=pose)

    def tell(self, view: DepthView, pose: NDArray[np.float64], header: Header) -> None:
        """Publish the frame of a header as seen by the camera.

        Parameters
        ----------
        pose
            (4, 4) of the camera in that frame.
        """
        if self._publisher is None or header.frame_id == view.frame:
            return
        if not view.frame:
            self._warnings.warn_once(
                "no_frame",
                f"frames of the camera name no frame_id: '{header.frame_id}' is not told",
            )
            return
        camera = Header(stamp=header.stamp, frame_id=view.frame)
        inverse = np.linalg.inv(pose).astype(np.float64)
        told = transform_message(camera, header.frame_id, inverse)
        self._publisher.publish(TFMessage(transforms=[told]))

    def close(self) -> None:
        """End all waiting."""
        self._listener.close()

    def report(self, name: str) -> DiagnosticStatus:
        """Return what became of the transforms under the name of who reports."""
        return self._listener.report(name)
