"""Where the door was: a robot that has driven up to it may hide it from the camera."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from kmn_skill.planning.layout import BASE_POSITION


class DoorMemory:
    """Keeps the parameters of the closed door that a goal last relied on; thread-safe.

    Attributes
    ----------
    interrupted
        Whether the goal that relied on them has not been reached.
    """

    def __init__(self) -> None:
        self.interrupted = False
        self._kept: tuple[NDArray[np.float64], NDArray[np.float64]] | None = None

    def keep(self, values: NDArray[np.float64], robot: NDArray[np.float64]) -> None:
        """Keep parameters (n + m,) and where the robot (J,) was when they were seen, m and rad."""
        self._kept, self.interrupted = (values, robot), True

    def forget(self) -> None:
        """Forget the door, as of another world."""
        self._kept = None

    def recall(self, robot: NDArray[np.float64], distance: float) -> NDArray[np.float64] | None:
        """Return the parameters (n + m,) if the robot has driven since they were seen.

        Parameters
        ----------
        robot
            (J,) present positions.
        distance
            Metres that it must have driven; from where it saw the door it does not hide it.
        """
        if (kept := self._kept) is None:
            return None
        values, before = kept
        return values if np.linalg.norm((robot - before)[BASE_POSITION]) > distance else None
