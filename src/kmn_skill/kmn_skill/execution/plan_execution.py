"""Follows one plan: sends it part by part, and monitors that robot and door follow."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kmn_skill.execution.errors import ExecutionError
from kmn_skill.execution.states import WorldState
from kmn_skill.planning.layout import BASE_POSITION, GRIPPER, HANDLE, HINGE
from kmn_skill.planning.phases import PhaseName
from kmn_skill.planning.plan import Plan

MIN_STEP = 1e-3  # seconds between the start of a part and its first point
SEND_AHEAD = 0.5  # part of its duration; a part is sent so early, while the former one runs


@dataclass(frozen=True)
class ExecutionSettings:
    """How a plan is followed.

    Attributes
    ----------
    start_delay
        Seconds between sending the first part and its start.
    part_duration, part_overlap
        Seconds of the plan that a part covers, and by which it reaches into the next one: if that
        never comes, the robot stops there.
    settle_time
        Seconds after the end until robot and door count as at rest.
    position_tolerance, angle_tolerance
        Largest tracking errors of the base's position (m) and of the other joints (rad).
    handle_slip, door_slip
        By which handle and door may stay behind the hand, radians.
    """

    start_delay: float
    part_duration: float
    part_overlap: float
    settle_time: float
    position_tolerance: float
    angle_tolerance: float
    handle_slip: float
    door_slip: float


class Part(NamedTuple):
    """A part of a plan, ready to be sent.

    Attributes
    ----------
    start
        Time at which it starts, seconds.
    times
        (P,) seconds since then, above 0 and increasing.
    positions, velocities
        (P, J) of all joints [m, rad] and per second; at rest in the end.
    """

    start: float
    times: NDArray[np.float64]
    positions: NDArray[np.float64]
    velocities: NDArray[np.float64]


class Step(NamedTuple):
    """What follows from a state of the world.

    Attributes
    ----------
    part
        To be sent now, if any.
    phase
        Name of the plan's present phase.
    progress
        Part of the plan's time that has passed, 0 to 1.
    finished
        Whether all is done and at rest.
    """

    part: Part | None
    phase: str
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
        elapsed = float(np.clip(state.time - self._start, 0.0, self._duration))
        point = int(np.searchsorted(self._plan.times, elapsed))
        phase = next(
            (phase.name for phase in self._plan.phases if point <= phase.last),
            self._plan.phases[-1].name,
        )
        self._check_tracking(elapsed, state)
        self._check_grasp(elapsed, phase, state)
        finished = state.time > self._start + self._duration + self._settings.settle_time
        return Step(self._due_part(now), phase, elapsed / self._duration, finished)

    def _due_part(self, now: float) -> Part | None:
        """Return the next part if it is time to send it."""
        duration, begin = self._settings.part_duration, self._sent
        if begin >= self._duration or (
            begin > 0.0 and now < self._start + begin - SEND_AHEAD * duration
        ):
            return None
        self._sent = begin + duration
        times = self._plan.times
        # After the first point: that is where the robot is when the part starts.
        first = int(np.searchsorted(times, begin + MIN_STEP))
        last = int(np.searchsorted(times, self._sent + self._settings.part_overlap))
        chosen = slice(first, last + 1)
        velocities = self._plan.velocities[chosen].copy()
        velocities[-1] = 0.0
        return Part(
            self._start + begin, times[chosen] - begin, self._plan.positions[chosen], velocities
        )

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

    def _check_grasp(self, elapsed: float, phase: str, state: WorldState) -> None:
        """Raise if the hand moves on, but handle or door does not follow."""
        desired = sample(self._plan.times, self._plan.door, elapsed)
        watched = {
            PhaseName.PRESS: ("handle", desired[HANDLE], state.handle, self._settings.handle_slip),
            PhaseName.OPEN: ("door", desired[HINGE], state.hinge, self._settings.door_slip),
        }
        if phase not in watched:
            return
        what, planned, measured, allowed = watched[phase]
        if abs(planned - measured) > allowed:
            raise ExecutionError(
                "slipped",
                f"the grasp slipped: the {what} is at {measured:.2f} rad, where the hand should "
                f"have it at {planned:.2f} rad",
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
    tolerances = np.full(count, settings.angle_tolerance)
    tolerances[BASE_POSITION] = settings.position_tolerance
    tolerances[GRIPPER] = np.inf  # it presses the handle and so never gets where it is sent
    return tolerances
