"""Which trajectory is followed at which time: replacement, deferred start, and holding."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from kmn_sim.control.interpolation import State
from kmn_sim.control.trajectory import Command, Trajectory, check


class TrajectoryController:
    """Follows the newest trajectory of a robot, or holds its position.

    A command that starts in the future waits, while what is done goes on; a newer one replaces it.
    Waypoints that lie in the past are left out. A new trajectory is reached from the present state:
    the desired one, so that a gripper that presses goes on to press, or the measured one.

    Parameters
    ----------
    limits
        Lower and upper position of each joint by name.
    positions
        (J,) where the joints are, m and rad.
    from_desired_state
        Whether the present state is the desired one.
    """

    def __init__(
        self,
        limits: Mapping[str, tuple[float, float]],
        positions: NDArray[np.float64],
        from_desired_state: bool,
    ) -> None:
        self._limits = dict(limits)
        self._from_desired_state = from_desired_state
        self._low, self._high = np.array(list(self._limits.values())).T
        self._running: Trajectory | None = None
        self._deferred: Trajectory | None = None
        self._desired = State.at_rest(positions)

    def accept(self, command: Command, now: float) -> None:
        """Take over a command; without points all joints hold where they are.

        Raises
        ------
        TrajectoryError
            If the command is refused; what is done goes on.
        """
        if not command.points:
            self._running = self._deferred = None
            return
        self._deferred = check(command, self._limits, now)

    def sample(self, now: float, measured: State) -> State:
        """Return the desired state at a time.

        Parameters
        ----------
        measured
            State in which the joints are.
        """
        self._follow(now)
        if self._deferred is not None and self._deferred.start <= now:
            present = self._desired if self._from_desired_state else measured
            self._running, self._deferred = self._deferred.follow_from(present, now), None
            self._follow(now)
        return self._desired

    def progress(self, now: float) -> float | None:
        """Return the part of the trajectory's time that has passed; None without a trajectory."""
        return None if self._running is None else self._running.progress(now)

    def _follow(self, now: float) -> None:
        """Advance the desired state along the running trajectory, or hold it."""
        if self._running is None:
            self._desired = State.at_rest(self._desired.positions)
            return
        desired = self._running.sample(now)
        inside = np.clip(desired.positions, self._low, self._high)
        self._desired = desired._replace(positions=inside)
