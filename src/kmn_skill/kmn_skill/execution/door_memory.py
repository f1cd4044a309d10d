"""Where the door was: a robot that has driven up to it may hide it from the camera."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from kmn_skill.planning.layout import BASE_POSITION


class DoorMemory:
    """Keeps the parameters of the closed door that were last relied upon; thread-safe.

    Attributes
    ----------
    interrupted
        Whether what they were relied upon for has not come to its end.
    """

    def __init__(self) -> None:
        self.interrupted = False
        self._kept: tuple[NDArray[np.float64], NDArray[np.float64]] | None = None

    def keep(self, values: NDArray[np.float64], robot: NDArray[np.float64]) -> None:
        """Keep parameters (n + m,) that were seen with the robot (J,) at some place [m, rad]."""
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
            Metres that it must have driven; a robot that still stands where it saw the door does
            not hide it.
        """
        if (kept := self._kept) is None:
            return None
        values, before = kept
        return values if np.linalg.norm((robot - before)[BASE_POSITION]) > distance else None
