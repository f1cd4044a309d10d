"""The newest states of robot and door, and whether they can be relied upon."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kmn_skill.execution.errors import StatesError
from kmn_skill.planning.layout import LATCH, MOVED

ROBOT, DOOR, BASE = "joint_states", "door_state", "odom"
TURN = 2.0 * np.pi  # radians
# Joints that do not jump: a handle that is let go springs back faster than anything drives it.
STEADY = {ROBOT: slice(None), BASE: slice(None), DOOR: slice(MOVED, MOVED + 1)}


@dataclass(frozen=True)
class StateSettings:
    """When states count as lost.

    Attributes
    ----------
    state_timeout
        Largest age of the newest, seconds.
    max_speed, max_jump
        Between two messages a joint moves by the speed (m/s, rad/s) times the time between them
        plus the jump (m, rad), or less; otherwise the world is another one.
    """

    state_timeout: float
    max_speed: float
    max_jump: float


class Sample(NamedTuple):
    """Positions (J,) of some joints at a time in seconds."""

    time: float
    positions: NDArray[np.float64]


class WorldState(NamedTuple):
    """Positions of robot and door.

    Attributes
    ----------
    time
        Of the robot's positions, seconds.
    robot
        (J,) base, arm and gripper [m, rad].
    hinge, handle
        Angles of the door, radians; NaN where nobody tells them.
    """

    time: float
    robot: NDArray[np.float64]
    hinge: float
    handle: float


class StateWatch:
    """Keeps the newest states; thread-safe.

    Parameters
    ----------
    joints
        Names of the joints of what is watched, for people to read: of `ROBOT`, of `BASE` where
        odometry alone tells of it, and of `DOOR` where somebody measures its angles.
    steady
        Returns the time of a clock that is never adjusted, seconds.
    continuous
        Names of joints of which a whole turn changes nothing. Their positions go on where others
        have them go back to the other end of a turn.

    Attributes
    ----------
    settings
        May be replaced.
    breaks
        How often the states jumped or their time went back, as when a simulation starts anew.
    last_break
        What happened then, for people to read.
    """

    def __init__(
        self,
        settings: StateSettings,
        joints: Mapping[str, Sequence[str]],
        steady: Callable[[], float] = time.monotonic,
        continuous: Sequence[str] = (),
    ) -> None:
        self.settings, self._steady = settings, steady
        self._names = joints
        self._continuous = {topic: np.isin(names, continuous) for topic, names in joints.items()}
        self._newest: dict[str, Sample] = {}
        self._received: dict[str, float] = {}
        self._changed = threading.Condition()
        self.breaks, self.last_break = 0, ""

    @property
    def tells_door(self) -> bool:
        """Whether somebody measures the door's angles."""
        return DOOR in self._names

    def put(self, topic: str, sample: Sample) -> None:
        """Take a state of `ROBOT`, `BASE` or `DOOR`."""
        with self._changed:
            before, told = self._newest.get(topic), sample
            if before is not None:
                sample = self._unwrapped(topic, before, told)
                if text := self._difference(topic, before, sample):
                    self.breaks += 1
                    self.last_break, sample = text, told
            self._newest[topic], self._received[topic] = sample, self._steady()
            self._changed.notify_all()

    def newest(self, now: float, breaks: int) -> WorldState:
        """Return the newest state.

        Parameters
        ----------
        now
            Present time on the clock of the states, seconds.
        breaks
            How many there were when the caller came to know the world.

        Raises
        ------
        StatesError
            If it is of another world, or too old, by its time or by when it came.
        """
        timeout = self.settings.state_timeout
        with self._changed:  # a state must not come between the two questions
            if self.breaks != breaks:
                raise StatesError("another_world", self.last_break)
            for topic in self._names:
                if topic not in self._newest:
                    raise StatesError("no_states", f"no {topic} came yet")
                silence = self._steady() - self._received[topic]
                if silence > timeout:
                    raise StatesError("states_stopped", f"{topic} stopped {silence:.2f} s ago")
                age = now - self._newest[topic].time
                if abs(age) > timeout:
                    raise StatesError(
                        "stale_states",
                        f"{topic} is {age:.2f} s old by its stamp, expected at most {timeout:g} s; "
                        "do the nodes share a clock (use_sim_time)?",
                    )
            robot, door = self._newest[ROBOT], self._newest.get(DOOR)
        angles: NDArray[np.float64] = np.zeros(2)  # of what nothing unlatches one alone is told
        angles[: None if door is None else door.positions.size] = (
            np.nan if door is None else door.positions
        )
        return WorldState(robot.time, robot.positions, float(angles[MOVED]), float(angles[LATCH]))

    def robot(self, now: float, timeout: float) -> Sample | None:
        """Return where the robot was measured last; None if that is not known.

        Parameters
        ----------
        now
            Present time on the clock of the states, seconds.
        timeout
            Largest age, by its time and by when it came, seconds.
        """
        with self._changed:
            newest = self._newest.get(ROBOT)
            if newest is None or self._steady() - self._received[ROBOT] > timeout:
                return None
            return newest if abs(now - newest.time) <= timeout else None

    def wait(self, timeout: float) -> None:
        """Wait until a state comes, but no longer than so many seconds."""
        with self._changed:
            self._changed.wait(timeout)

    def _unwrapped(self, topic: str, before: Sample, after: Sample) -> Sample:
        """Return the second state with its continuous joints nearest to where they were."""
        turns = np.round((before.positions - after.positions) / TURN)
        return after._replace(
            positions=after.positions + np.where(self._continuous[topic], turns * TURN, 0.0)
        )

    def _difference(self, topic: str, before: Sample, after: Sample) -> str:
        """Return why two states cannot belong to one motion; empty if they can."""
        passed = after.time - before.time
        if passed < 0.0:
            return f"the time of {topic} went back by {-passed:.2f} s"
        moved = np.abs(after.positions - before.positions)[STEADY[topic]]
        excess = moved - self.settings.max_speed * passed - self.settings.max_jump
        worst = int(np.argmax(excess))
        if excess[worst] > 0.0:
            name = self._names[topic][worst]
            return f"{name} jumped by {moved[worst]:.2f} within {passed:.3f} s"
        return ""
