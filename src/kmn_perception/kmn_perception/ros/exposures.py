"""Which frames are new: a camera's cloud and image of one exposure come as two messages."""

from __future__ import annotations

from enum import Enum

SILENCE = 10 * 10**9  # ns after which a source counts as one that was never heard
MAX_LAG = 10**9  # ns that such a source may be behind; beyond it time itself went back


class Order(Enum):
    """How a frame follows those that came before it."""

    NEW = "new"
    SUPERSEDED = "superseded"  # another source has shown this moment, or a later one
    CLOCK_JUMP = "clock jump"  # time went back, that of its own source or that of all


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
            whether the clock was set back; one that was silent, whether it is far behind.
        stamp
            Time of the exposure, nanoseconds; 0 for messages without a time, which are always new.
        """
        before = self._newest.get(source)
        others = max((t for name, t in self._newest.items() if name != source), default=-1)
        silent = before is None or before < others - SILENCE
        if (before is not None and stamp < before) or (silent and stamp < others - MAX_LAG):
            self._newest = {source: stamp}
            return Order.CLOCK_JUMP
        self._newest[source] = stamp
        return Order.SUPERSEDED if stamp and stamp <= others else Order.NEW
