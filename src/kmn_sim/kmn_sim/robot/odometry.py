"""Where the robot takes its base to be, from the motion of its wheels."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

AHEAD_AND_LEFT = np.array([[1.0, -1.0], [1.0, 1.0]]) / np.sqrt(2.0)  # by 45 degrees


class Odometry:
    """Adds up what the base moves, with an error in proportion to the way.

    The error is ahead of the motion and to its left in equal parts, as of wheels that are larger
    than they are taken to be and of a heading that is off.

    Parameters
    ----------
    place
        (2,) where the base begins, metres; there the odometry has it, too.
    drift
        Metres of error for each metre.
    """

    def __init__(self, place: NDArray[np.float64], drift: float) -> None:
        self._place, self._error = place.copy(), np.zeros(2)
        self._drift = drift * AHEAD_AND_LEFT

    def place(self, place: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return where the odometry has a base (2,) that is now at a place (2,), metres."""
        self._error += self._drift @ (place - self._place)
        self._place = place.copy()
        return place + self._error
