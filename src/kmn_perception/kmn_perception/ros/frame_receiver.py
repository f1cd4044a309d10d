"""Takes clouds, depth images and their descriptions, and keeps the newest frame."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, NamedTuple

from rclpy.node import Node
from sensor_msgs.msg import CameraInfo, CompressedImage, Image, PointCloud2
from std_msgs.msg import Header

from kmn_perception.ros.camera_subscriptions import CameraSubscriptions
from kmn_perception.ros.exposures import Exposures, Order
from kmn_perception.ros.frame_statistics import FrameStatistics
from kmn_perception.ros.image_transport import transported
from kmn_perception.ros.mailbox import Mailbox
from kmn_perception.ros.message_gaps import MessageGaps
from kmn_perception.ros.messages import MessageError, view_from_cloud, view_from_image
from kmn_perception.ros.messages.compressed import raw_depth
from kmn_perception.ros.messages.reading import is_distorted
from kmn_perception.ros.morph_node_parameters import MorphNodeSettings
from kmn_perception.ros.reports import ThrottledWarnings
from kmn_perception.scene.depth_view import DepthView


class Frame(NamedTuple):
    """A message that waits for its estimation.

    ``read`` returns what was seen, given the node's settings, or raises `MessageError`;
    ``received`` is in seconds of the monotonic clock.
    """

    header: Header
    read: Callable[[MorphNodeSettings], DepthView]
    received: float


class FrameReceiver:
    """The subscriptions of a node to one camera.

    Parameters
    ----------
    node, subscriptions
        Who subscribes, and how.
    settings
        Returns the node's present settings.

    Attributes
    ----------
    camera_info
        The newest description of the depth camera, if one came.
    """

    def __init__(
        self,
        node: Node,
        subscriptions: CameraSubscriptions,
        settings: Callable[[], MorphNodeSettings],
        statistics: FrameStatistics,
        warnings: ThrottledWarnings,
    ) -> None:
        self._settings, self._statistics, self._warnings = settings, statistics, warnings
        self._mailbox: Mailbox[Frame] = Mailbox()
        self._exposures = Exposures()
        self._gaps = MessageGaps()
        self._early_image: tuple[Image | CompressedImage, float] | None = (
            None  # before any camera_info, and since
        )
        self.camera_info: CameraInfo | None = None
        # Taken in this order where several came: an image after the camera_info published with it.
        subscriptions.subscribe(CameraInfo, "depth/camera_info", self._on_camera_info)
        kind, topic = transported(node, "depth/image", settings().depth_image_transport)
        subscriptions.subscribe(kind, topic, self._on_image)
        subscriptions.subscribe(PointCloud2, "points", self._on_points)

    def take(self) -> Frame | None:
        """Wait for the newest frame and take it; None once the receiver is closed."""
        return self._mailbox.take()

    def close(self) -> None:
        """End the waiting."""
        self._mailbox.close()

    def _on_points(self, cloud: PointCloud2, info: Mapping[str, Any]) -> None:
        self._statistics.lose(self._gaps.add("points", info))
        self._submit("points", cloud.header, partial(read_cloud, cloud))

    def _on_image(self, image: Image | CompressedImage, info: Mapping[str, Any]) -> None:
        """Submit an image with the newest camera_info, or keep it until the first one comes."""
        self._statistics.lose(self._gaps.add("depth/image", info))
        if self.camera_info is not None:
            self._submit_image(image, self.camera_info)
            return
        self.refuse_early_image()
        self._early_image = image, time.monotonic()

    def _on_camera_info(self, camera_info: CameraInfo) -> None:
        self.camera_info = camera_info
        early, self._early_image = self._early_image, None
        if early is not None:
            self._submit_image(early[0], camera_info)

    def refuse_early_image(self, waited: float = 0.0) -> None:
        """Refuse an image that has waited so long (s) for the first camera_info."""
        if self._early_image is None or time.monotonic() - self._early_image[1] < waited:
            return
        (image, _), self._early_image = self._early_image, None
        self._submit("depth/image", image.header, _refuse_without_info)

    def _submit_image(self, image: Image | CompressedImage, info: CameraInfo) -> None:
        if is_distorted(info) and self._settings().rectify:
            self._warnings.warn_once(
                "rectified",
                f"camera_info has a distortion ({info.distortion_model}): depth images are "
                "rectified; where they are rectified already, set rectify:=false",
            )
        if image.header.frame_id == self._settings().world_frame:
            self._warnings.warn_once(
                "image_in_world",
                f"depth images are stamped with the world frame '{image.header.frame_id}', "
                "expected the camera's optical frame; they are taken as seen by the camera",
            )
        self._submit("depth/image", image.header, partial(_read_image, image, info))

    def _submit(
        self, source: str, header: Header, read: Callable[[MorphNodeSettings], DepthView]
    ) -> None:
        """Hand the newest frame to the estimation thread."""
        stamp = header.stamp.sec * 10**9 + header.stamp.nanosec
        order = self._exposures.add(source, stamp)
        if order is Order.SUPERSEDED:
            self._statistics.supersede()
            return
        if order is Order.CLOCK_JUMP:
            self._statistics.count_clock_jump()
            self._warnings.warn("clock_jump", f"stamps of {source} went back to {stamp / 1e9} s")
        replaced = self._mailbox.put(Frame(header, read, time.monotonic()))
        self._statistics.receive(replaced)


def read_cloud(cloud: PointCloud2, settings: MorphNodeSettings) -> DepthView:
    """Read a cloud as a node's settings have it."""
    return view_from_cloud(cloud, settings.max_range, settings.world_frame)


def _read_image(
    image: Image | CompressedImage, info: CameraInfo, settings: MorphNodeSettings
) -> DepthView:
    return view_from_image(raw_depth(image), info, settings.max_range, settings.rectify)


def _refuse_without_info(settings: MorphNodeSettings) -> DepthView:
    raise MessageError("no_camera_info", "depth/image came without depth/camera_info")
