"""Interpolation between the waypoints of joint trajectories, as ros2_control's splines."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray


class State(NamedTuple):
    """State of J joints; velocities and accelerations are NaN where they are not given.

    Attributes
    ----------
    positions
        (J,) m or rad.
    velocities, accelerations
        (J,) the same per second and per second squared.
    """

    positions: NDArray[np.float64]
    velocities: NDArray[np.float64]
    accelerations: NDArray[np.float64]

    @classmethod
    def at_rest(cls, positions: NDArray[np.float64]) -> State:
        """Return the state of joints that stand still."""
        return cls(positions.copy(), np.zeros_like(positions), np.zeros_like(positions))

    def of(self, columns: list[int]) -> State:
        """Return the state of some of the joints."""
        return State(*(values[columns] for values in self))


def nearest(
    positions: NDArray[np.float64],
    reference: NDArray[np.float64],
    continuous: NDArray[np.bool_],
) -> NDArray[np.float64]:
    """Return positions (J,) turned by whole turns to be nearest to others, where that is the same.

    Parameters
    ----------
    reference
        (J,) or (1,) radians.
    continuous
        (J,) whether a whole turn of a joint changes nothing.
    """
    turns = 2.0 * np.pi * np.round((reference - positions) / (2.0 * np.pi))
    return np.where(continuous, positions + turns, positions)


def interpolate(start: State, end: State, duration: float, time: float) -> State:
    """Return the state between two states.

    Linear where only positions are given, cubic where both states have velocities, quintic where
    both have accelerations too.

    Parameters
    ----------
    duration
        From the first state to the second one, seconds; above 0.
    time
        Since the first state, seconds within [0, duration].
    """
    t, T = time, duration
    p0, v0, a0 = start
    p1, v1, a1 = end
    step = (p1 - p0) / T
    if np.isnan(v0).any() or np.isnan(v1).any():
        return State(p0 + step * t, step, np.zeros_like(p0))
    if np.isnan(a0).any() or np.isnan(a1).any():
        a0, c3 = 2.0 * (3.0 * step - 2.0 * v0 - v1) / T, (v0 + v1 - 2.0 * step) / T**2
        c4 = c5 = np.zeros_like(p0)
    else:
        c3 = (20.0 * step - 12.0 * v0 - 8.0 * v1 - (3.0 * a0 - a1) * T) / (2.0 * T**2)
        c4 = (-30.0 * step + 16.0 * v0 + 14.0 * v1 + (3.0 * a0 - 2.0 * a1) * T) / (2.0 * T**3)
        c5 = (12.0 * step - 6.0 * (v0 + v1) - (a0 - a1) * T) / (2.0 * T**4)
    return State(
        p0 + t * (v0 + t * (a0 / 2.0 + t * (c3 + t * (c4 + t * c5)))),
        v0 + t * (a0 + t * (3.0 * c3 + t * (4.0 * c4 + t * 5.0 * c5))),
        a0 + t * (6.0 * c3 + t * (12.0 * c4 + t * 20.0 * c5)),
    )
