"""A base that is driven by velocities, as by ``cmd_vel``."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kmn_perception.configuration.settings import Positive
from kmn_perception.model.transformation import rotation_z
from kmn_sim.control.interpolation import State
from kmn_sim.control.trajectory import TrajectoryError

YAW = 2  # of the base's joints


class VelocityLimits(NamedTuple):
    """What stops a base, and how fast.

    Attributes
    ----------
    timeout
        Seconds after the last velocity until the base stops.
    acceleration
        Largest ones ahead, to the left and of the turn, m/s^2 and rad/s^2.
    """

    timeout: Positive
    acceleration: tuple[Positive, Positive, Positive]


class VelocityController:
    """Drives with the newest velocity, as diff_drive_controller of ros2_controllers does.

    Parameters
    ----------
    speeds
        (3,) largest ones ahead, to the left and of the turn, m/s and rad/s.
    limits
        What else limits its motion.
    """

    def __init__(self, speeds: NDArray[np.float64], limits: VelocityLimits) -> None:
        self._speeds, self._timeout = speeds, limits.timeout
        self._acceleration = np.array(limits.acceleration)
        self._wanted: NDArray[np.float64] = np.zeros(3)
        self._driven: NDArray[np.float64] = np.zeros(3)
        self._until = -math.inf  # when the newest velocity is too old
        self._sampled = math.nan

    def accept(self, velocity: NDArray[np.float64], sent: float, now: float) -> None:
        """Take over a velocity (3,) in the base's frame: ahead, to the left, and of the turn.

        Parameters
        ----------
        sent, now
            When it was sent, and the present time, seconds.

        Raises
        ------
        TrajectoryError
            If it is refused; then the one before remains.
        """
        if not np.isfinite(velocity).all():
            raise TrajectoryError(
                "not_finite", f"the velocity is not finite: {np.asarray(velocity).tolist()}"
            )
        if now - sent > self._timeout:
            raise TrajectoryError(
                "in_the_past",
                f"the velocity is {now - sent:.3f} s old, expected at most {self._timeout:g} s",
            )
        self._wanted = np.clip(velocity, -self._speeds, self._speeds)
        self._until = now + self._timeout

    def sample(self, now: float, measured: State) -> State:
        """Return the desired state of the base's joints (3,) at a time."""
        passed = 0.0 if math.isnan(self._sampled) else now - self._sampled
        self._sampled = now
        wanted = self._wanted if now <= self._until else np.zeros(3)
        change = self._acceleration * passed
        self._driven += np.clip(wanted - self._driven, -change, change)
        velocities = rotation_z(measured.positions[YAW]) @ [*self._driven[:YAW], 0.0]
        velocities[YAW] = self._driven[YAW]
        return State(measured.positions.copy(), velocities, np.zeros(3))
