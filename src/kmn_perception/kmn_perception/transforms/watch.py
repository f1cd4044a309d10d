"""Notices what makes transforms doubtful that a buffer takes as they are."""

from __future__ import annotations

import math

import numpy as np

from kmn_perception.transforms.settings import NANOSECONDS, TransformSettings
from kmn_perception.transforms.transform import Transform, TransformError


class _Frame:
    """What was seen of a frame: its last transform, pauses in which it moved, changed parents."""

    def __init__(self, last: Transform) -> None:
        self.last = last
        self.pauses: list[tuple[Transform, Transform]] = []
        self.changes: list[tuple[int, str]] = []  # stamps, and the parents until then


class TransformWatch:
    """Sees every transform, beside the buffer. Not thread-safe."""

    def __init__(self, settings: TransformSettings) -> None:
        self._settings = settings
        self._frames: dict[str, _Frame] = {}
        self._contested: dict[str, tuple[str, str]] = {}

    def see(self, transform: Transform, static: bool = False, alone: bool = True) -> bool:
        """Take note of a transform; True if time went back for its frame.

        Parameters
        ----------
        static
            It holds at all times.
        alone
            There is but one who publishes those.
        """
        known = self._frames.get(transform.child)
        if known is None:
            self._frames[transform.child] = _Frame(transform)
            return False
        last, known.last = known.last, transform
        if static:
            if last.parent != transform.parent and not alone:
                self._contested[transform.child] = last.parent, transform.parent
            return False
        elapsed = (transform.stamp - last.stamp) / NANOSECONDS
        if elapsed < -self._settings.max_disorder:
            known.pauses.clear()
            known.changes.clear()
            return True
        if last.parent != transform.parent:
            known.changes.append((transform.stamp, last.parent))
        elif elapsed > self._settings.max_gap and self._moved(last, transform):
            known.pauses.append((last, transform))
        oldest = transform.stamp - round(self._settings.cache_time * NANOSECONDS)
        known.changes = [change for change in known.changes if change[0] > oldest]
        known.pauses = [pause for pause in known.pauses if pause[1].stamp > oldest]
        return False

    def check(self, target: str, source: str, stamp: int) -> None:
        """Raise `TransformError` if the way between two frames is doubtful at a time.

        Parameters
        ----------
        stamp
            Nanoseconds; 0: the latest.
        """
        for name in self._above(target) ^ self._above(source):
            known = self._frames[name]
            parents = self._contested.get(name)
            if len(known.changes) > 1:
                parents = known.changes[-1][1], known.last.parent
            if parents is not None:
                raise TransformError(
                    "two_parents",
                    f"frame '{name}' has two parents, '{parents[0]}' and '{parents[1]}'",
                )
            for before, after in known.pauses:
                if before.stamp < stamp < after.stamp:
                    raise TransformError(
                        "gap",
                        f"frame '{name}' moved while there was no transform of it for "
                        f"{(after.stamp - before.stamp) / NANOSECONDS:.2f} s",
                    )

    def _above(self, frame: str) -> set[str]:
        """Return a frame and those above it, without the root."""
        passed: set[str] = set()
        while frame in self._frames and frame not in passed:
            passed.add(frame)
            frame = self._frames[frame].last.parent
        return passed

    def _moved(self, one: Transform, other: Transform) -> bool:
        still = self._settings.still
        first, second = np.array(one.quaternion), np.array(other.quaternion)
        angle = 2.0 * min(np.linalg.norm(first - second), np.linalg.norm(first + second))
        return bool(
            math.dist(one.translation, other.translation) > still.distance or angle > still.angle
        )
