"""Which frames are new: a camera's cloud and image of one exposure come as two messages."""

from __future__ import annotations

from enum import Enum


class Order(Enum):
    """How a frame follows those that came before it."""

    NEW = "new"
    SUPERSEDED = "superseded"  # another source has shown this moment, or a later one
    CLOCK_JUMP = "clock jump"  # its own source's time went back


class Exposures:
    """The newest stamps of the sources of one camera."""

    def __init__(self) -> None:
        self._newest: dict[str, int] = {}

    def add(self, source: str, stamp: int) -> Order:
        """Tell how a frame follows those before it.

        Parameters
        ----------
        source
            The topic that it came from. Two of them may run one period apart, and each alone tells
            whether the clock was set back.
        stamp
            Time of the exposure, nanoseconds; 0 for messages without a time, which are always new.
        """
        if stamp < self._newest.get(source, stamp):
            self._newest = {source: stamp}
            return Order.CLOCK_JUMP
        others = [newest for name, newest in self._newest.items() if name != source]
        self._newest[source] = stamp
        return Order.SUPERSEDED if stamp and stamp <= max(others, default=-1) else Order.NEW
