"""Where odometry has the base, and by which velocities it follows its share of a plan."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kmn_perception.model.transformation import rotation_z, wrap
from kmn_skill.execution.plan_execution import Part, sample

YAW = 2  # of a pose and of a velocity
EXTRAPOLATED = 0.1  # seconds for which a base goes on as it was told to move


class Motion(NamedTuple):
    """What odometry tells of the base at a time (s).

    Attributes
    ----------
    pose
        (3,) x, y and yaw in the frame of odometry, m and rad.
    velocity
        (3,) ahead, to the left and of the turn, per second.
    frame
        Of the base.
    """

    time: float
    pose: NDArray[np.float64]
    velocity: NDArray[np.float64]
    frame: str

    def at(self, time: float) -> NDArray[np.float64]:
        """Return the pose (3,) at a time just before or after."""
        passed = np.clip(time - self.time, -EXTRAPOLATED, EXTRAPOLATED)
        halfway = self.pose[YAW] + 0.5 * passed * self.velocity[YAW]
        return self.pose + passed * in_odometry(self.velocity, halfway)


@dataclass(frozen=True)
class TrackingSettings:
    """How a base that takes velocities follows a plan.

    Attributes
    ----------
    base_gain
        Part of the error that is taken away in a second, 1/s.
    base_delay
        Seconds after which it drives with a velocity that it is sent.
    base_position_tolerance, base_angle_tolerance
        By how much it may miss the plan's end, m and rad.
    odometry_timeout
        Largest age of what odometry tells, seconds.
    """

    base_gain: float
    base_delay: float
    base_position_tolerance: float
    base_angle_tolerance: float
    odometry_timeout: float


class BaseOdometry:
    """Keeps what odometry told last.

    Parameters
    ----------
    steady
        Returns the time of a clock that is never adjusted, seconds.
    """

    def __init__(self, steady: Callable[[], float] = time.monotonic) -> None:
        self._steady = steady
        self._told: tuple[Motion, float] | None = None  # and when it came

    @property
    def newest(self) -> Motion | None:
        """What was told last, however old."""
        told = self._told
        return told and told[0]

    def put(self, motion: Motion) -> None:
        """Take what odometry tells."""
        self._told = motion, self._steady()

    def fault(self, now: float, timeout: float) -> str:
        """Return why odometry cannot be relied upon; empty if it can.

        Parameters
        ----------
        now
            Present time on the clock of its stamps, seconds.
        timeout
            Largest age, by its time and by when it came, seconds.
        """
        told = self._told
        if told is None:
            return "no odometry came yet"
        motion, received = told
        age = max(now - motion.time, self._steady() - received)
        if age > timeout:
            return f"odometry is {age:.2f} s old, expected at most {timeout:g} s"
        return ""


class BaseTracking:
    """A base on its way: the plan's velocity, and a part of the error that odometry tells.

    Parameters
    ----------
    share
        Of the plan, of the base's joints.
    speeds
        (3,) largest velocities, m/s and rad/s.
    """

    def __init__(
        self, share: Part, speeds: NDArray[np.float64], settings: TrackingSettings
    ) -> None:
        self._share, self._speeds, self._settings = share, speeds, settings
        self.end = share.start + float(share.times[-1])

    def velocity(self, now: float, motion: Motion) -> NDArray[np.float64]:
        """Return the velocity (3,) for now: ahead, to the left, and of the turn."""
        _, times, _, velocities = self._share
        driven = now + self._settings.base_delay
        planned = sample(times, velocities, driven - self._share.start)
        if not self._share.start <= driven <= self.end:
            planned = np.zeros(3)
        wanted = planned + self._settings.base_gain * self.error(motion)
        ahead = in_base(wanted, motion.at(now)[YAW])
        return ahead / max(1.0, float((np.abs(ahead) / self._speeds).max()))

    def error(self, motion: Motion) -> NDArray[np.float64]:
        """Return by how much the base (3,) is not where the plan had it then, m and rad."""
        _, times, positions, _ = self._share
        error = sample(times, positions, motion.time - self._share.start) - motion.pose
        error[YAW] = wrap(error[YAW])
        return error

    def is_through(self, now: float, motion: Motion) -> bool:
        """Tell whether the base is at the plan's end."""
        settings, (x, y, yaw) = self._settings, self.error(motion)
        return bool(
            min(now, motion.time) >= self.end
            and np.hypot(x, y) <= settings.base_position_tolerance
            and abs(yaw) <= settings.base_angle_tolerance
        )


def in_odometry(velocity: NDArray[np.float64], yaw: float) -> NDArray[np.float64]:
    """Return a velocity (3,) of a base that is turned by an angle in the frame of odometry."""
    turned: NDArray[np.float64] = rotation_z(np.asarray(yaw)) @ [*velocity[:YAW], 0.0]
    turned[YAW] = velocity[YAW]
    return turned


def in_base(velocity: NDArray[np.float64], yaw: float) -> NDArray[np.float64]:
    """Return the velocity (3,) of which `in_odometry` makes another one."""
    return in_odometry(velocity, -yaw)
