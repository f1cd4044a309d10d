"""The buffer that transforms are kept in: tf2's where it is installed, else our own."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
from geometry_msgs.msg import TransformStamped
from numpy.typing import NDArray
from rclpy.duration import Duration
from rclpy.time import Time
from std_msgs.msg import Header

from kmn_perception.model.rotation import matrix_from_quaternion
from kmn_perception.ros.messages.transforms import set_transform
from kmn_perception.transforms.buffer import TransformBuffer
from kmn_perception.transforms.transform import Reason, Transform, TransformError

try:
    import tf2_ros
except ImportError:  # the wheels have no tf2
    tf2_ros = None

AUTHORITY = "kmn_perception"


class Buffer(Protocol):
    """What a listener needs of a buffer, see `TransformBuffer`."""

    def set(self, transform: Transform, static: bool = False) -> None:
        """Keep a transform that was checked."""

    def forget(self, frame: str) -> None:
        """Forget the past of a frame that moves."""

    def lookup(self, target: str, source: str, stamp: int) -> NDArray[np.float64]:
        """Return the pose (4, 4) of ``source`` in ``target`` at a time (ns, 0 the latest)."""


def make_buffer(cache_time: float) -> Buffer:
    """Return the buffer to use, which keeps transforms for so long (s)."""
    return TransformBuffer(cache_time) if tf2_ros is None else Tf2Buffer(cache_time)


class Tf2Buffer:
    """tf2's buffer, with our errors."""

    def __init__(self, cache_time: float) -> None:
        self._buffer: Any = tf2_ros.Buffer(cache_time=Duration(seconds=cache_time))

    def set(self, transform: Transform, static: bool = False) -> None:
        """Keep a transform that was checked."""
        header = Header(stamp=Time(nanoseconds=transform.stamp).to_msg(), frame_id=transform.parent)
        message = TransformStamped(header=header, child_frame_id=transform.child)
        set_transform(message, transform.translation, transform.quaternion)
        if static:
            self._buffer.set_transform_static(message, AUTHORITY)
        else:
            self._buffer.set_transform(message, AUTHORITY)

    def forget(self, frame: str) -> None:
        """Forget the past of all frames that move: tf2 cannot forget one."""
        self._buffer.clear()

    def lookup(self, target: str, source: str, stamp: int) -> NDArray[np.float64]:
        """Return the pose (4, 4) of ``source`` in ``target`` at a time (ns, 0 the latest)."""
        try:
            found = self._buffer.lookup_transform_core(target, source, Time(nanoseconds=stamp))
        except tf2_ros.TransformException as error:
            raise TransformError(_reason(error), str(error)) from error
        place, turn = found.transform.translation, found.transform.rotation
        pose = np.eye(4)
        pose[:3, :3] = matrix_from_quaternion([turn.x, turn.y, turn.z, turn.w])
        pose[:3, 3] = place.x, place.y, place.z
        return pose


def _reason(error: Exception) -> Reason:
    """Return the reason that an exception of tf2 is."""
    if isinstance(error, tf2_ros.ExtrapolationException):
        return "too_old" if "into the past" in str(error) else "stale"
    if isinstance(error, tf2_ros.ConnectivityException):
        return "disconnected"
    return "loop" if "loop" in str(error) else "unknown_frame"
