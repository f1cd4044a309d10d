"""Follows one plan: sends it part by part, and monitors that robot and door follow."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kmn_skill.execution.errors import ExecutionError
from kmn_skill.execution.states import WorldState
from kmn_skill.planning.layout import BASE_POSITION, GRIPPER, LATCH, MOVED
from kmn_skill.planning.phases import PhaseName
from kmn_skill.planning.plan import Plan

SEND_AHEAD = 0.5  # part of its duration; a part is sent so early, while the former one runs


@dataclass(frozen=True)
class ExecutionSettings:
    """How a plan is followed.

    Attributes
    ----------
    start_delay
        Seconds between sending the first part and its start.
    part_duration, part_overlap
        Seconds of the plan that a part adds, and by which it reaches into the next one: if that
        never comes, the robot stops there. Infinite: the plan is one part.
    hold_duration
        Seconds in which a robot that is to hold comes to rest.
    settle_time
        Seconds after the end until robot and door count as at rest.
    position_tolerance, angle_tolerance
        Largest tracking errors of the base's position (m) and of the other joints (rad).
    handle_slip, door_slip
        By which what unlatches the object, and the object, may stay behind the hand, m or rad.
    """

    start_delay: float
    part_duration: float
    part_overlap: float
    hold_duration: float
    settle_time: float
    position_tolerance: float
    angle_tolerance: float
    handle_slip: float
    door_slip: float


class Part(NamedTuple):
    """A part of a plan, ready to be sent.

    It begins with the last point that the robot has passed, so that it holds all that is left of
    the part before, which a controller forgets at once.

    Attributes
    ----------
    start
        Time at which the plan starts, seconds.
    times
        (P,) seconds since then, increasing.
    positions, velocities
        (P, J) of all joints [m, rad] and per second; at rest in the end.
    """

    start: float
    times: NDArray[np.float64]
    positions: NDArray[np.float64]
    velocities: NDArray[np.float64]

    def of(self, columns: list[int]) -> Part:
        """Return the part of some of the joints."""
        return self._replace(
            positions=self.positions[:, columns], velocities=self.velocities[:, columns]
        )


class Step(NamedTuple):
    """What follows from a state of the world.

    Attributes
    ----------
    part
        To be sent now, if any.
    progress
        Part of the plan's time that has passed, 0 to 1.
    finished
        Whether all is done and at rest.
    """

    part: Part | None
    progress: float
    finished: bool


class Execution:
    """One plan on its way.

    Parameters
    ----------
    now
        Present time on the clock of the robot's states, seconds.

    Attributes
    ----------
    tracking_error
        Largest one so far, in units of the tolerances.
    """

    def __init__(self, plan: Plan, now: float, settings: ExecutionSettings) -> None:
        self._plan, self._settings = plan, settings
        self._start = now + settings.start_delay
        self._duration = float(plan.times[-1])
        self._sent = 0.0  # seconds of the plan that were sent
        self._tolerances = _tolerances(len(plan.joint_names), settings)
        self.tracking_error = 0.0

    def step(self, now: float, state: WorldState) -> Step:
        """Return what to send at a time, and how far the plan is.

        Raises
        ------
        ExecutionError
            If the robot is not where it should be, or the grasp slipped.
        """
        elapsed = self._elapsed(state.time)
        self._check_tracking(elapsed, state)
        self._check_grasp(state)
        finished = state.time > self._start + self._duration + self._settings.settle_time
        return Step(self._due_part(now, elapsed), elapsed / self._duration, finished)

    def planned(self, time: float) -> tuple[str, NDArray[np.float64]]:
        """Return the plan's phase at a time, and the angles (2,) that it then has the door at."""
        elapsed = self._elapsed(time)
        point = int(np.searchsorted(self._plan.times, elapsed))
        phase = next(
            (phase.name for phase in self._plan.phases if point <= phase.last),
            self._plan.phases[-1].name,
        )
        return phase, sample(self._plan.times, self._plan.object_joints, elapsed)

    def _elapsed(self, time: float) -> float:
        """Return the seconds of the plan that have passed at a time."""
        return float(np.clip(time - self._start, 0.0, self._duration))

    def position(self, now: float) -> NDArray[np.float64]:
        """Return where the parts that were sent have the robot at a time (J,), m and rad."""
        elapsed = min(now - self._start, self._sent + self._settings.part_overlap)
        return sample(self._plan.times, self._plan.positions, elapsed)

    def _due_part(self, now: float, elapsed: float) -> Part | None:
        """Return the next part if it is time to send it.

        Parameters
        ----------
        elapsed
            Seconds of the plan that the robot has passed.
        """
        duration, overlap = self._settings.part_duration, self._settings.part_overlap
        begin, due = self._sent, self._start + self._sent - SEND_AHEAD * duration
        if begin > 0.0 and (begin + overlap >= self._duration or now < due):
            return None
        self._sent = max(begin, now - self._start) + duration
        times = self._plan.times
        first = int(np.searchsorted(times, elapsed, side="right")) - 1
        last = int(np.searchsorted(times, self._sent + overlap))
        chosen = slice(first, last + 1)
        velocities = self._plan.velocities[chosen].copy()
        velocities[-1] = 0.0
        return Part(self._start, times[chosen], self._plan.positions[chosen], velocities)

    def _check_tracking(self, elapsed: float, state: WorldState) -> None:
        desired = sample(self._plan.times, self._plan.positions, elapsed)
        errors = np.abs(state.robot - desired) / self._tolerances
        worst = int(np.argmax(errors))
        self.tracking_error = max(self.tracking_error, float(errors[worst]))
        if errors[worst] > 1.0:
            raise ExecutionError(
                "tracking",
                f"{self._plan.joint_names[worst]} is off its trajectory by "
                f"{errors[worst] * self._tolerances[worst]:.3f}, "
                f"expected at most {self._tolerances[worst]:g} [m, rad]",
            )

    def _check_grasp(self, state: WorldState) -> None:
        """Raise if the hand moves on, but handle or door does not follow."""
        phase, desired = self.planned(state.time)
        watched = {
            PhaseName.PRESS: (desired[LATCH], state.handle, self._settings.handle_slip),
            PhaseName.OPEN: (desired[MOVED], state.hinge, self._settings.door_slip),
        }
        if phase not in watched:
            return
        planned, measured, allowed = watched[phase]
        if abs(planned - measured) > allowed:
            raise ExecutionError(
                "slipped",
                f"the grasp slipped: what is moved is at {measured:.2f}, where the hand should "
                f"have it at {planned:.2f} [m, rad]",
            )


def sample(
    times: NDArray[np.float64], table: NDArray[np.float64], time: float
) -> NDArray[np.float64]:
    """Return the row (J,) of a table (T, J) at a time, linear between its times (T,)."""
    after = int(np.clip(np.searchsorted(times, time), 1, len(times) - 1))
    weight = np.clip((time - times[after - 1]) / (times[after] - times[after - 1]), 0.0, 1.0)
    row: NDArray[np.float64] = (1.0 - weight) * table[after - 1] + weight * table[after]
    return row


def _tolerances(count: int, settings: ExecutionSettings) -> NDArray[np.float64]:
    """Return the largest tracking errors (J,) of the robot's joints, m and rad."""
    largest = np.full(count, settings.angle_tolerance)
    largest[BASE_POSITION] = settings.position_tolerance
    largest[GRIPPER] = np.inf  # it presses the handle and so never gets where it is sent
    return largest
