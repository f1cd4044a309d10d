"""Takes the images that a camera publishes beside its depth, and finds the one of a frame."""

from __future__ import annotations

import threading
from collections import Counter, deque
from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.node import Node
from sensor_msgs.msg import CameraInfo, CompressedImage, Image

from kmn_perception.ros.camera_subscriptions import CameraSubscription, CameraSubscriptions
from kmn_perception.ros.image_transport import transported
from kmn_perception.ros.messages import MessageError
from kmn_perception.ros.messages.compressed import raw_image
from kmn_perception.ros.messages.grey import grey_in_view
from kmn_perception.ros.morph_node_parameters import MorphNodeSettings
from kmn_perception.ros.reports import ThrottledWarnings, make_status
from kmn_perception.ros.stamps import NANOSECONDS
from kmn_perception.scene.depth_view import DepthView

KEPT = 32  # images, of which the depth may be the last to come
MAX_LAG = 10**9  # ns by which a stamp may be behind; beyond it time itself went back


class _Stamped(NamedTuple):
    stamp: int
    image: Image | CompressedImage


class ImageReceiver:
    """The subscriptions to ``image`` and ``image/camera_info``, and the newest images.

    Parameters
    ----------
    node, subscriptions, transport
        Who subscribes, how, and to which transport of the image.
    warnings
        Where to tell what is wrong with images.
    """

    def __init__(
        self,
        node: Node,
        subscriptions: CameraSubscriptions,
        transport: str,
        warnings: ThrottledWarnings,
    ) -> None:
        self._node, self._subscriptions, self._warnings = node, subscriptions, warnings
        self._kind, topic = transported(node, "image", transport)
        self._topics = [node.resolve_topic_name("image/camera_info"), topic]
        for name in self._topics:
            subscriptions.declare(name)
        self._listening: list[CameraSubscription] = []
        self._changed = threading.Condition()
        self._images: deque[_Stamped] = deque(maxlen=KEPT)
        self._info: CameraInfo | None = None
        self._counts: Counter[str] = Counter()
        self._last = "no image was needed"

    def listen(self, wanted: bool) -> None:
        """Subscribe, or no longer."""
        if wanted and not self._listening:
            subscribe = self._subscriptions.subscribe
            self._listening = [
                subscribe(CameraInfo, self._topics[0], self._on_info),
                subscribe(self._kind, self._topics[1], self._on_image),
            ]
        elif not wanted:
            for subscription in self._listening:
                self._subscriptions.end(subscription)
            self._listening = []
            with self._changed:
                self._images.clear()
                self._info = None

    def add_to(
        self, view: DepthView, settings: MorphNodeSettings, patience: float
    ) -> tuple[DepthView, str]:
        """Return a view with the grey values of its exposure, or why there are none.

        Parameters
        ----------
        patience
            Seconds to wait for an image that is not there yet.
        """
        if not settings.use_image or not self._listening or not view.is_organised:
            return view, ""
        has_info, has_images = (self._node.count_publishers(topic) > 0 for topic in self._topics)
        if not self._images and not has_images:
            return view, ""
        with self._changed:
            self._changed.wait_for(self._has_come(view.stamp, has_info), max(patience, 0.0))
            found = min(
                reversed(self._images), key=lambda kept: abs(kept.stamp - view.stamp), default=None
            )
            info = self._info
        if found is None:
            return view, self._miss("missing", "no image has come yet")
        lag = (view.stamp - found.stamp) / NANOSECONDS
        if abs(lag) > settings.image_delay:
            self._warnings.warn_once(
                "image_late",
                "images have no stamps within image_delay of those of the depth, "
                f"{settings.image_delay:g} s: frames are estimated by depth alone",
            )
            return view, self._miss(
                "late",
                f"the nearest is {abs(lag):.2f} s {'older' if lag > 0.0 else 'newer'} than the "
                f"depth, image_delay is {settings.image_delay:g} s",
            )
        if info is None and has_info:
            return view, self._miss("without_info", "image/camera_info has not come yet")
        try:
            intensity = grey_in_view(raw_image(found.image), info, view, settings.rectify)
        except MessageError as error:
            self._warnings.warn(error.reason, f"image refused, {error.reason}: {error}")
            return view, self._miss(f"refused_{error.reason}", str(error))
        self._check_frame(found.image, view)
        with self._changed:
            self._counts["used"] += 1
            self._last = "OK"
        return replace(view, intensity=intensity), ""

    def report(self, name: str) -> DiagnosticStatus:
        """Return what became of the images under the name of who reports."""
        with self._changed:
            counts, last = dict(self._counts), self._last
        values = {f"images_{key}": str(count) for key, count in sorted(counts.items())}
        return make_status(name, last.startswith("not used"), last, values)

    def _has_come(self, stamp: int, needs_info: bool) -> Callable[[], bool]:
        """Return the condition that no image can come that is nearer to a stamp, nanoseconds."""

        def has_come() -> bool:
            described = self._info is not None or not needs_info
            return described and any(kept.stamp >= stamp for kept in self._images)

        return has_come

    def _miss(self, key: str, reason: str) -> str:
        """Count an image that is not used; return why."""
        with self._changed:
            self._counts[key] += 1
            self._last = f"not used: {reason}"
        return f"the image was not used: {reason}"

    def _check_frame(self, image: Image | CompressedImage, view: DepthView) -> None:
        if image.header.frame_id != view.frame:
            self._warnings.warn_once(
                "image_frame",
                f"the image is of the frame '{image.header.frame_id}', the depth of "
                f"'{view.frame}'; both are taken as seen from the same place: where they are not, "
                "publish an image that is registered to the depth",
            )

    def _on_info(self, info: CameraInfo) -> None:
        with self._changed:
            self._info = info
            self._changed.notify_all()

    def _on_image(self, image: Image | CompressedImage) -> None:
        stamp = image.header.stamp.sec * NANOSECONDS + image.header.stamp.nanosec
        with self._changed:
            if self._images and stamp < self._images[-1].stamp - MAX_LAG:
                self._images.clear()
            self._images.append(_Stamped(stamp, image))
            self._counts["received"] += 1
            self._changed.notify_all()
