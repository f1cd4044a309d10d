"""Opens a door: waits for its parameters, plans, follows the plan, and tries again if need be."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.model.parts import Joint
from kmn_skill.execution.door_memory import DoorMemory
from kmn_skill.execution.errors import (
    DoorError,
    ExecutionError,
    GoalError,
    SkillError,
    StatesError,
)
from kmn_skill.execution.goal import SUCCESS, Client, Commands, Feedback, Goal, Result
from kmn_skill.execution.perceived_door import PerceivedDoor, when_closed
from kmn_skill.execution.plan_execution import Execution, ExecutionSettings
from kmn_skill.execution.states import StateWatch, WorldState
from kmn_skill.planning.layout import HANDLE, HINGE
from kmn_skill.planning.phases import PhaseName
from kmn_skill.planning.plan import Plan, PlanningCancelled, PlanningFailed, PlanReport, PlanRequest
from kmn_skill.planning.planner import Planner
from kmn_skill.planning.surroundings import WALL, Obstacle, SurroundingsSettings, wall_around

POLL_PERIOD = 0.05  # seconds between two looks for a cancellation
# Why a door that the robot hides from the camera is not to be relied on.
HIDDEN = ("status", "out_of_limits", "few_frames", "disagreement", "uncertain")


@dataclass(frozen=True)
class OpeningSettings:
    """How long and how often it is tried, and what counts as reached.

    Attributes
    ----------
    door_timeout
        Seconds that a goal waits for parameters to rely on.
    retries
        Further attempts after the robot or the door did not follow.
    handle_tolerance, door_tolerance
        By which the angles (rad) may miss the goal.
    hidden_distance
        Metres after which the robot hides the door; then where it was before is relied upon.
    surroundings, recess
        Whether a ``wall`` stands around the door, and how deep (m) the panel's front lies in it
        where perception does not tell.
    """

    door_timeout: float
    retries: int
    handle_tolerance: float
    door_tolerance: float
    hidden_distance: float
    surroundings: str
    recess: float


class Knowledge(NamedTuple):
    """What is known of the world, and kept from goal to goal.

    Attributes
    ----------
    model
        Kinematic model of the door.
    door, memory
        The door as it is seen, and as it was seen before the robot hid it.
    watch
        Of the states of robot and door.
    wall
        Around the door, where there is one.
    """

    model: KinematicModel
    door: PerceivedDoor
    memory: DoorMemory
    watch: StateWatch
    wall: SurroundingsSettings


class DoorOpening:
    """One goal, from its check to its result.

    Parameters
    ----------
    knowledge
        Of the world.
    planner, commands
        What plans and what moves.
    client
        Who wants the door to be opened.
    settings, execution
        Of the opening, and of following a plan.
    """

    def __init__(
        self,
        knowledge: Knowledge,
        planner: Planner,
        commands: Commands,
        client: Client,
        settings: OpeningSettings,
        execution: ExecutionSettings,
    ) -> None:
        self._model, self._door, self._memory, self._watch, self._wall = knowledge
        self._planner, self._commands, self._client = planner, commands, client
        self._settings, self._execution = settings, execution
        self._breaks = self._watch.breaks
        self._handle = self._hinge = math.nan
        self._plan_report: PlanReport | None = None
        self._attempts = 0
        self._tracking_error = 0.0

    def run(self, goal: Goal) -> Result:
        """Open the door; in the end the robot stands still, whatever happened."""
        try:
            self._check(goal)
            self._open(goal)
            self._memory.interrupted = False
        except SkillError as error:
            self._commands.hold()
            return self._result(error.reason, str(error))
        except Exception:
            self._commands.hold()
            raise
        return self._result(SUCCESS, "")

    def _result(self, outcome: str, reason: str) -> Result:
        return Result(
            outcome,
            reason,
            self._handle,
            self._hinge,
            self._plan_report,
            self._attempts,
            self._tracking_error,
        )

    def _check(self, goal: Goal) -> None:
        """Raise if the door's joints cannot have the goal's angles."""
        joints = self._model.joints
        _check_angle("handle_angle", goal.handle_angle, joints[HANDLE])
        _check_angle("door_angle", goal.door_angle, joints[HINGE])
        if abs(goal.door_angle) <= self._settings.door_tolerance:
            raise GoalError(
                "bad_goal",
                f"door_angle = {goal.door_angle:g} does not open the door, expected more than "
                f"the tolerance {self._settings.door_tolerance:g} rad to either side",
            )

    def _open(self, goal: Goal) -> None:
        """Plan and follow, with some retries; raise if the last one fails."""
        values = self._wait_for_door()
        for retries_left in reversed(range(self._settings.retries + 1)):
            try:
                self._follow(self._plan(values, goal))
                self._check_reached(goal)
                return
            except ExecutionError as error:
                self._commands.hold()
                if not retries_left:
                    raise
                self._commands.tell(f"{error}; trying again from here")

    def _wait_for_door(self) -> NDArray[np.float64]:
        """Return the parameters (n + m,) of the door when closed."""
        deadline = time.monotonic() + self._settings.door_timeout
        while True:
            self._breaks = self._watch.breaks  # until now the world may have changed
            try:
                state = self._state()
                self._report(PhaseName.WAIT, 0.0, state)
                return self._door_from(state)
            except (StatesError, DoorError):
                if time.monotonic() > deadline:
                    raise
            time.sleep(POLL_PERIOD)

    def _door_from(self, state: WorldState) -> NDArray[np.float64]:
        """Return the parameters (n + m,) of the closed door, as seen before the robot hid it."""
        before = self._memory.recall(state.robot, self._settings.hidden_distance)
        try:
            seen = self._door.values(self._commands.now())
        except DoorError as error:
            if before is None or not self._memory.interrupted or error.reason not in HIDDEN:
                raise
        if before is not None:
            self._commands.tell("relying on where the door was before the robot drove up to it")
            return before
        values = when_closed(self._model, seen, state.hinge)
        self._memory.keep(values, state.robot)
        return values

    def _plan(self, values: NDArray[np.float64], goal: Goal) -> Plan:
        state = self._state()
        self._report(PhaseName.PLAN, 0.0, state)
        self._attempts += 1
        theta, gamma = self._model.split(values)
        request = PlanRequest(
            theta=theta,
            gamma=gamma,
            start=state.robot,
            door_start=np.array([state.hinge, state.handle]),
            handle_angle=goal.handle_angle,
            door_angle=goal.door_angle,
            obstacles=self._obstacles(gamma),
        )
        try:
            plan = self._planner.plan(request, lambda: self._client.interruption() is not None)
        except PlanningCancelled:
            self._go_on()
            raise
        except PlanningFailed as error:
            raise SkillError("no_plan", f"there is no plan: {error}") from error
        self._plan_report = plan.report
        self._commands.show(plan, values)
        return plan

    def _obstacles(self, gamma: NDArray[np.float64]) -> tuple[Obstacle, ...]:
        """Return what stands around a door of configuration parameters (m,)."""
        if self._settings.surroundings != WALL:
            return ()
        seen = self._door.recess
        recess = seen if math.isfinite(seen) else self._settings.recess
        return wall_around(self._model, gamma, recess, self._wall)

    def _follow(self, plan: Plan) -> None:
        """Send a plan part by part until all is done and at rest."""
        execution = Execution(plan, self._commands.now(), self._execution)
        finished = False
        while not finished:
            state = self._state()
            part, phase, progress, finished = execution.step(self._commands.now(), state)
            self._tracking_error = max(self._tracking_error, execution.tracking_error)
            if part is not None:
                self._commands.send(part)
            self._report(phase, progress, state)
            self._watch.wait(POLL_PERIOD)

    def _state(self) -> WorldState:
        """Return the newest state; raise if the goal ends or the world is another one."""
        self._go_on()
        state = self._watch.newest(self._commands.now(), self._breaks)
        self._hinge = state.hinge
        if not abs(state.handle) <= abs(self._handle):
            self._handle = state.handle
        return state

    def _go_on(self) -> None:
        """Raise if the goal is not wanted any more."""
        if interruption := self._client.interruption():
            raise interruption

    def _report(self, phase: str, progress: float, state: WorldState) -> None:
        self._client.feed_back(Feedback(phase, progress, state.handle, state.hinge))

    def _check_reached(self, goal: Goal) -> None:
        """Raise if handle or door are not where the goal has them."""
        settings = self._settings
        for what, reached, wanted, tolerance in (
            ("handle", self._handle, goal.handle_angle, settings.handle_tolerance),
            ("door", self._hinge, goal.door_angle, settings.door_tolerance),
        ):
            if math.copysign(1.0, wanted) * reached < abs(wanted) - tolerance:
                raise ExecutionError(
                    "missed", f"the {what} came to {reached:.2f} rad, expected {wanted:.2f} rad"
                )


def _check_angle(name: str, angle: float, joint: Joint) -> None:
    low, high = joint.limits
    if not low <= angle <= high:
        raise GoalError(
            "bad_goal",
            f"{name} = {angle:g} is beyond the joint '{joint.name}', "
            f"expected [{low:g}, {high:g}] rad",
        )
