"""What is known of one frame over time."""

from __future__ import annotations

from bisect import bisect_left, bisect_right

from kmn_perception.transforms.settings import NANOSECONDS
from kmn_perception.transforms.transform import Reason, Transform, TransformError, between


class History:
    """The transforms of a frame in the order of their stamps.

    Parameters
    ----------
    cache_time
        For which they are kept, nanoseconds.
    """

    def __init__(self, cache_time: int) -> None:
        self._cache_time = cache_time
        self._stamps: list[int] = []
        self._transforms: list[Transform] = []

    @property
    def newest(self) -> Transform:
        """The one with the newest stamp."""
        return self._transforms[-1]

    def add(self, transform: Transform) -> bool:
        """Keep a transform; False if it is older than what is kept."""
        stamp = transform.stamp
        if self._stamps and stamp < self._stamps[-1] - self._cache_time:
            return False
        place = bisect_right(self._stamps, stamp)
        self._stamps.insert(place, stamp)
        self._transforms.insert(place, transform)
        old = bisect_left(self._stamps, self._stamps[-1] - self._cache_time)
        del self._stamps[:old], self._transforms[:old]
        return True

    def at(self, stamp: int) -> Transform:
        """Return where the frame was at a time (ns); between two parents' it is the older one's.

        Raises
        ------
        TransformError
            If that would have to be extrapolated.
        """
        place = bisect_right(self._stamps, stamp)
        if place and self._stamps[place - 1] == stamp:
            return self._transforms[place - 1]
        if place == len(self._stamps):
            raise self._error("stale", stamp, "newest", self._transforms[-1], "older")
        if place == 0:
            raise self._error("too_old", stamp, "oldest", self._transforms[0], "newer")
        older, newer = self._transforms[place - 1], self._transforms[place]
        if older.parent != newer.parent:
            return older
        return between(older, newer, stamp)

    @staticmethod
    def _error(reason: Reason, stamp: int, which: str, kept: Transform, how: str) -> TransformError:
        late = abs(kept.stamp - stamp) / NANOSECONDS
        return TransformError(
            reason,
            f"the {which} transform from '{kept.parent}' to '{kept.child}' is {late:.2f} s {how} "
            "than what was asked for",
        )


class Resting:
    """A frame that does not move: its last transform holds at all times."""

    def __init__(self, transform: Transform) -> None:
        self.newest = transform

    def at(self, stamp: int) -> Transform:
        """Return where the frame was at a time (ns): where it always is."""
        return self.newest._replace(stamp=stamp)
