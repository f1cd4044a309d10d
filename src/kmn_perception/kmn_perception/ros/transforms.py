"""Listens to ``/tf`` and ``/tf_static``, and tells where frames are in each other."""

from __future__ import annotations

import threading
import time
from collections import Counter
from functools import partial

import numpy as np
from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import TransformStamped
from numpy.typing import NDArray
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.subscription import Subscription
from tf2_msgs.msg import TFMessage

from kmn_perception.ros.overridable_node import overridden
from kmn_perception.ros.reports import ThrottledWarnings, make_status
from kmn_perception.ros.stamps import NANOSECONDS
from kmn_perception.ros.tf2_buffer import make_buffer
from kmn_perception.transforms.settings import TransformSettings
from kmn_perception.transforms.transform import Transform, TransformError
from kmn_perception.transforms.watch import TransformWatch

QUEUE_DEPTH = 100
POLL_PERIOD = 0.02  # seconds
TOPICS = {"/tf": DurabilityPolicy.VOLATILE, "/tf_static": DurabilityPolicy.TRANSIENT_LOCAL}
MAY_COME = ("unknown_frame", "disconnected", "loop", "stale")  # what a later transform may mend


class TransformListener:
    """Keeps the transforms of a node's graph; looked up in any thread.

    What moves is listened to once a look-up needs it: robots tell much of it, and where a camera
    stands fixed in the world it would be taken in for nothing.

    Parameters
    ----------
    node, warnings
        Who listens, and where to tell what is wrong with transforms.
    """

    def __init__(self, node: Node, warnings: ThrottledWarnings) -> None:
        self._node, self._warnings = node, warnings
        settings = TransformSettings.load()
        self._buffer, self._watch = make_buffer(settings.cache_time), TransformWatch(settings)
        self._subscriptions: dict[str, Subscription] = {}
        self._profiles = {
            topic: overridden(
                node, Subscription, topic, QoSProfile(depth=QUEUE_DEPTH, durability=d)
            )
            for topic, d in TOPICS.items()
        }
        self._changed = threading.Condition()
        self._counts: Counter[str] = Counter()
        self._last = "no transform was needed"
        self._open, self._settled = True, time.monotonic() + settings.discovery

    def listen(self, wanted: bool) -> None:
        """Begin to listen, or end it."""
        if wanted:
            self._subscribe("/tf_static")
            return
        for subscription in self._subscriptions.values():
            self._node.destroy_subscription(subscription)
        self._subscriptions.clear()

    def close(self) -> None:
        """End all waiting."""
        with self._changed:
            self._open = False
            self._changed.notify_all()

    def anyone_tells(self, patient: bool = False) -> bool:
        """Tell whether there are transforms, or somebody who publishes them.

        Parameters
        ----------
        patient
            Wait until that is sure; not in the executor's thread.
        """
        with self._changed:
            while True:
                if self._counts["received"] or any(map(self._publishers, TOPICS)):
                    return True
                if not patient or not self._open or time.monotonic() > self._settled:
                    return False
                self._changed.wait(POLL_PERIOD)

    def lookup(
        self, target: str, source: str, stamp: int, patience: float = 0.0
    ) -> NDArray[np.float64]:
        """Return the pose (4, 4) of a frame (``source``) in another one.

        Parameters
        ----------
        stamp
            Nanoseconds; 0: the latest time at which all of it is known.
        patience
            Seconds to wait for transforms that are not there yet; not in the executor's thread.

        Raises
        ------
        TransformError
            If it is not known.
        """
        deadline = time.monotonic() + patience
        with self._changed:
            while True:
                try:
                    self._watch.check(target, source, stamp)
                    pose = self._buffer.lookup(target, source, stamp)
                except TransformError as error:
                    if error.reason in MAY_COME and self._subscriptions:
                        self._subscribe("/tf")
                    remaining = deadline - time.monotonic()
                    if error.reason in MAY_COME and remaining > 0.0 and self._open:
                        self._changed.wait(remaining)
                        continue
                    self._counts[f"failed_{error.reason}"] += 1
                    self._last = f"{error.reason}: {error}"
                    raise
                self._counts["found"] += 1
                self._last = "OK"
                return pose

    def report(self, name: str) -> DiagnosticStatus:
        """Return what became of the transforms under the name of who reports."""
        with self._changed:
            counts, last = dict(self._counts), self._last
        values = {f"transforms_{key}": str(count) for key, count in sorted(counts.items())}
        return make_status(name, ":" in last, last, values)

    def _publishers(self, topic: str) -> int:
        return self._node.count_publishers(self._node.resolve_topic_name(topic))

    def _subscribe(self, topic: str) -> None:
        if topic not in self._subscriptions:
            self._subscriptions[topic] = self._node.create_subscription(
                TFMessage, topic, partial(self._take, topic), self._profiles[topic]
            )

    def _take(self, topic: str, message: TFMessage) -> None:
        static = topic == "/tf_static"
        alone = not static or self._publishers(topic) <= 1
        with self._changed:
            for each in message.transforms:
                transform = _transform(each)
                try:
                    transform.check()
                except TransformError as error:
                    self._counts["refused"] += 1
                    self._warnings.warn("transform", f"transform refused: {error}")
                    continue
                self._counts["received"] += 1
                if self._watch.see(transform, static, alone):
                    self._counts["jumps_back"] += 1
                    self._warnings.warn(
                        "transform_jump", f"stamps of frame '{transform.child}' went back"
                    )
                    self._buffer.forget(transform.child)
                self._buffer.set(transform, static)
            self._changed.notify_all()


def _transform(message: TransformStamped) -> Transform:
    """Read a transform; a slash before a frame's name is left out, as tf2 does."""
    stamp, place, turn = (
        message.header.stamp,
        message.transform.translation,
        message.transform.rotation,
    )
    return Transform(
        message.header.frame_id.lstrip("/"),
        message.child_frame_id.lstrip("/"),
        stamp.sec * NANOSECONDS + stamp.nanosec,
        (place.x, place.y, place.z),
        (turn.x, turn.y, turn.z, turn.w),
    )
