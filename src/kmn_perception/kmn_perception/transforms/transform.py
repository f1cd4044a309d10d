"""A frame's pose in another one, as it is told; and why poses are not known."""

from __future__ import annotations

import math
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kmn_perception.model.rotation import matrix_from_quaternion

MAX_LENGTH_ERROR = 0.01  # of a quaternion's squared length, as tf2 has it


Reason = Literal[
    "invalid",  # it is refused; all others are of one that is looked up
    "unknown_frame",
    "disconnected",
    "loop",
    "stale",  # the newest is older
    "too_old",  # the oldest kept is newer
    "gap",
    "two_parents",
]


class TransformError(ValueError):
    """A transform is refused, or not known; the text says why."""

    def __init__(self, reason: Reason, text: str) -> None:
        super().__init__(text)
        self.reason: Reason = reason


class Transform(NamedTuple):
    """The pose of a frame (``child``) in another one.

    Attributes
    ----------
    stamp
        Nanoseconds.
    translation
        Metres.
    quaternion
        x, y, z, w.
    """

    parent: str
    child: str
    stamp: int
    translation: tuple[float, float, float]
    quaternion: tuple[float, float, float, float]

    @property
    def pose(self) -> NDArray[np.float64]:
        """(4, 4) of the child in the parent."""
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = matrix_from_quaternion(self.quaternion), self.translation
        return pose

    def check(self) -> None:
        """Raise `TransformError` if it is not a transform."""
        if not self.parent or not self.child:
            raise TransformError(
                "invalid", f"a transform from '{self.parent}' to '{self.child}' names no frame"
            )
        if self.parent == self.child:
            raise TransformError("invalid", f"frame '{self.child}' is its own parent")
        if not all(map(math.isfinite, (*self.translation, *self.quaternion))):
            raise TransformError("invalid", f"the transform of '{self.child}' is not finite")
        length = math.fsum(number * number for number in self.quaternion)
        if abs(length - 1.0) > MAX_LENGTH_ERROR:
            raise TransformError(
                "invalid",
                f"the quaternion of '{self.child}' has the length {math.sqrt(length):.3f}, "
                "expected 1",
            )


def between(older: Transform, newer: Transform, stamp: int) -> Transform:
    """Interpolate between two transforms of a frame: lines, and the shorter arc (slerp)."""
    share = (stamp - older.stamp) / (newer.stamp - older.stamp)
    x, y, z = (a + share * (b - a) for a, b in zip(older[3], newer[3], strict=True))
    first, second = np.array(older.quaternion), np.array(newer.quaternion)
    first, second = first / np.linalg.norm(first), second / np.linalg.norm(second)
    if first @ second < 0.0:
        second = -second
    angle = 2.0 * math.atan2(np.linalg.norm(first - second), np.linalg.norm(first + second))
    if angle > 0.0:
        weights = np.sin([(1.0 - share) * angle, share * angle]) / math.sin(angle)
        first = weights[0] * first + weights[1] * second
    a, b, c, d = first.tolist()
    return older._replace(stamp=stamp, translation=(x, y, z), quaternion=(a, b, c, d))
