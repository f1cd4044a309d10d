"""Keeps transforms and composes them, with the semantics of tf2's buffer."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from kmn_perception.transforms.history import History, Resting
from kmn_perception.transforms.settings import NANOSECONDS
from kmn_perception.transforms.transform import Transform, TransformError


class TransformBuffer:
    """The tree of frames over time. Not thread-safe.

    Parameters
    ----------
    cache_time
        Seconds for which transforms are kept.
    """

    def __init__(self, cache_time: float) -> None:
        self._cache_time = round(cache_time * NANOSECONDS)
        self._frames: dict[str, History | Resting] = {}
        self._names: set[str] = set()

    def set(self, transform: Transform, static: bool = False) -> None:
        """Keep a transform that was checked; one older than all that is kept is not used."""
        self._names.update(transform[:2])
        if static:
            self._frames[transform.child] = Resting(transform)
            return
        history = self._frames.get(transform.child)
        if not isinstance(history, History):
            history = self._frames[transform.child] = History(self._cache_time)
        history.add(transform)

    def forget(self, frame: str) -> None:
        """Forget the past of a frame that moves."""
        if isinstance(self._frames.get(frame), History):
            del self._frames[frame]

    def lookup(self, target: str, source: str, stamp: int) -> NDArray[np.float64]:
        """Return the pose (4, 4) of a frame (``source``) in another one.

        Parameters
        ----------
        stamp
            Nanoseconds; 0: the latest time at which all of it is known.

        Raises
        ------
        TransformError
            If it is not known.
        """
        if target == source:
            return np.eye(4)
        for frame in (target, source):
            if frame not in self._names:
                raise TransformError(
                    "unknown_frame",
                    f"no transform names the frame '{frame}'; the roots of those that are named: "
                    f"{', '.join(sorted(self._names - self._frames.keys())) or 'none'}",
                )
        if stamp == 0:
            stamp = self._latest(target, source)
        missing: TransformError | None = None
        pose = np.eye(4)
        up = {source: pose}  # poses of the source in the frames above it
        try:
            for transform in self._climb(source, stamp):
                if target in up:
                    break
                pose = transform.pose @ pose
                up[transform.parent] = pose
        except TransformError as error:
            if error.reason == "loop":
                raise
            missing = error  # there may be a way all the same
        pose, frame = np.eye(4), target
        climb = self._climb(target, stamp)
        while frame not in up:
            step = next(climb, None)
            if step is None:
                raise missing or self._disconnected(target, source)
            pose, frame = step.pose @ pose, step.parent
        found: NDArray[np.float64] = np.linalg.inv(pose) @ up[frame]
        return found

    def _climb(self, frame: str, stamp: int) -> Iterator[Transform]:
        """Yield the transforms from a frame up to its root."""
        passed = {frame}
        while (history := self._frames.get(frame)) is not None:
            transform = history.at(stamp)
            yield transform
            frame = transform.parent
            if frame in passed:
                raise TransformError("loop", f"frames are in a loop: {', '.join(sorted(passed))}")
            passed.add(frame)

    def _latest(self, target: str, source: str) -> int:
        """Return the latest time (ns) at which two frames' newest ancestors are all known."""
        chains = [self._newest(source), self._newest(target)]
        common = {transform.child for transform in chains[0]} & {
            transform.child for transform in chains[1]
        }
        stamps = [
            transform.stamp
            for chain in chains
            for transform in chain
            if transform.child not in common and isinstance(self._frames[transform.child], History)
        ]
        return min(stamps, default=0)

    def _newest(self, frame: str) -> list[Transform]:
        """Return the newest transforms from a frame up to its root."""
        chain: list[Transform] = []
        while (history := self._frames.get(frame)) is not None and history.newest not in chain:
            chain.append(history.newest)
            frame = history.newest.parent
        return chain

    def _disconnected(self, target: str, source: str) -> TransformError:
        roots = [
            ([frame, *(t.parent for t in self._newest(frame))])[-1] for frame in (target, source)
        ]
        return TransformError(
            "disconnected",
            f"'{target}' and '{source}' are in two trees, with the roots '{roots[0]}' and "
            f"'{roots[1]}'",
        )
