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
from kmn_skill.planning.layout import HANDLE, HINGE

ROBOT, DOOR = "joint_states", "door_state"
# Joints that do not jump: a handle that is let go springs back faster than anything drives it.
STEADY = {ROBOT: slice(None), DOOR: slice(HINGE, HINGE + 1)}


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
        Angles of the door, radians.
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
        Names of the joints of `ROBOT` and `DOOR`, for people to read.
    steady
        Returns the time of a clock that is never adjusted, seconds.

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
    ) -> None:
        self.settings, self._steady = settings, steady
        self._names = joints
        self._newest: dict[str, Sample] = {}
        self._received: dict[str, float] = {}
        self._changed = threading.Condition()
        self.breaks, self.last_break = 0, ""

    def put(self, topic: str, sample: Sample) -> None:
        """Take a state of `ROBOT` or `DOOR`."""
        with self._changed:
            before = self._newest.get(topic)
            if before is not None and (text := self._difference(topic, before, sample)):
                self.breaks += 1
                self.last_break = text
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
            robot, door = self._newest[ROBOT], self._newest[DOOR].positions
        return WorldState(robot.time, robot.positions, float(door[HINGE]), float(door[HANDLE]))

    def wait(self, timeout: float) -> None:
        """Wait until a state comes, but no longer than so many seconds."""
        with self._changed:
            self._changed.wait(timeout)

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
