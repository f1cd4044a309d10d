"""Opens a door: waits for its parameters, plans, follows the plan, and tries again if need be."""

from __future__ import annotations

import math
import time
from functools import partial

import numpy as np
from numpy.typing import NDArray

from kmn_skill.execution.door_observation import when_closed
from kmn_skill.execution.errors import (
    BlockedHandError,
    DoorError,
    ExecutionError,
    SkillError,
    StatesError,
)
from kmn_skill.execution.following import STUCK, RobotFollowing
from kmn_skill.execution.goal import SUCCESS, Client, Commands, Goal, Outcome, Result
from kmn_skill.execution.goal_check import check_goal, check_reached
from kmn_skill.execution.grasp_quantities import hinge_distance, swung, with_handle_moved
from kmn_skill.execution.held_door import MISSED_HANDLE
from kmn_skill.execution.knowledge import Knowledge
from kmn_skill.execution.looking import Looking
from kmn_skill.execution.opening_settings import OpeningSettings
from kmn_skill.execution.plan_execution import ExecutionSettings
from kmn_skill.execution.states import WorldState
from kmn_skill.planning.phases import PhaseName
from kmn_skill.planning.plan import Plan, PlanningCancelled, PlanningFailed, PlanReport, PlanRequest
from kmn_skill.planning.planner import Planner
from kmn_skill.planning.surroundings import WALL, Obstacle, wall_around

POLL_PERIOD = 0.05  # seconds between two looks for a cancellation
ELSEWHERE = ("slipped", "missed", MISSED_HANDLE)  # reasons why the door may not be where it was
# Why a door that the robot hides from the camera is not to be relied on.
HIDDEN = ("status", "out_of_limits", "few_frames", "disagreement", "uncertain")


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
        self._model, self._door, self._memory = knowledge.model, knowledge.door, knowledge.memory
        self._watch, self._held, self._wall = knowledge.watch, knowledge.held, knowledge.wall
        self._others, self._action = knowledge.others, self._model.actions[0]
        self._planner, self._commands, self._client = planner, commands, client
        self._settings = settings
        self._robot = RobotFollowing(knowledge, commands, client, execution)
        self._looking = Looking(knowledge, planner, commands, self._robot, settings)
        self._plan_report: PlanReport | None = None
        self._attempts = 0

    def run(self, goal: Goal) -> Result:
        """Open the door; in the end the robot stands still, whatever happened."""
        try:
            check_goal(goal, self._action, self._settings.door_tolerance)
            self._open(goal)
            self._memory.reach_goal()
        except SkillError as error:
            self._robot.hold()
            return self._result(error.reason, str(error))
        except Exception:
            self._robot.hold()
            raise
        return self._result(SUCCESS, "")

    def _result(self, outcome: Outcome, reason: str) -> Result:
        robot, plan = self._robot, self._plan_report
        return Result(
            outcome, reason, robot.handle, robot.hinge, plan, self._attempts, robot.tracking_error
        )

    def _open(self, goal: Goal) -> None:
        """Plan and follow, with some retries; raise if the last one fails."""
        settings = self._settings
        values, is_elsewhere, setback, blocked = self._wait_for_door(), False, "", None
        tolerances = settings.handle_tolerance, settings.door_tolerance
        check = partial(check_reached, goal=goal, action=self._action, tolerances=tolerances)
        for retries_left in reversed(range(settings.retries + 1)):
            try:
                if is_elsewhere and self._planner.drives:
                    self._looking.again(values)
                    self._memory.forget()
                    values = self._wait_for_door(values)
                if self._is_there(goal):
                    self._commands.tell("it is open as far as it is to be opened already")
                    return
                self._robot.reach(self._plan(values, goal), check)
                return
            except ExecutionError as error:
                self._robot.hold()
                if not retries_left or error.reason == STUCK:
                    raise
                if isinstance(error, BlockedHandError):
                    values, is_elsewhere = self._felt(values, error.offset(blocked)), False
                    blocked = error
                    self._commands.tell(f"{error}; trying again where the fingers found it")
                    continue
                is_elsewhere |= self._looking.carries_camera or error.reason in ELSEWHERE
                again, setback = "looking" if is_elsewhere else "trying", str(error)
                self._commands.tell(f"{error}; {again} again from here")
            except DoorError as error:
                raise DoorError(error.reason, f"{error}; before, {setback}") from error

    def _is_there(self, goal: Goal) -> bool:
        """Tell whether what is to be opened is at its target, and does not fall shut."""
        hinge = self._robot.state().hinge
        is_near = abs(hinge - goal.target) <= self._settings.door_tolerance
        return is_near and not self._held.falls_shut(hinge)

    def _felt(
        self, values: NDArray[np.float64], offset: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return parameters (n + m,) by which the handle is elsewhere by an offset (3,)."""
        felt = with_handle_moved(self._model, values, self._door.covariance, offset)
        self._held.see(felt, self._robot.state().hinge)
        return felt

    def _wait_for_door(self, closed: NDArray[np.float64] | None = None) -> NDArray[np.float64]:
        """Return the parameters (n + m,) of the door when closed; move to see it if need be.

        Parameters
        ----------
        closed
            (n + m,) of the closed door, if this goal knew it before.
        """
        deadline = time.monotonic() + self._settings.door_timeout
        while True:
            self._robot.begin()  # until now the world may have changed
            try:
                state = self._robot.state()
                self._robot.report(PhaseName.WAIT, 0.0, state)
                self._remember(state)
                if not self._looking.move_to_see(state):
                    return self._door_from(state, closed)
                deadline = time.monotonic() + self._settings.door_timeout
            except DoorError as error:
                if time.monotonic() > deadline:
                    raise self._looking.reason(error) from error
            except (StatesError, ExecutionError):
                if time.monotonic() > deadline:
                    raise
            time.sleep(POLL_PERIOD)

    def _remember(self, state: WorldState) -> None:
        """Take over what was known of a door that the hand holds, before the program began anew."""
        before = self._memory.kept
        shape = len(self._model.parameters), state.robot.size
        self._memory.restore(self._commands.now(), self._settings.memory_age, shape)
        kept = self._memory.kept
        if kept is before or kept is None:
            return
        if kept.grip is None:
            self._held.see(kept.values, 0.0)
        else:
            self._held.resume(kept.values, kept.grip, state.robot)

    def _door_from(
        self, state: WorldState, closed: NDArray[np.float64] | None
    ) -> NDArray[np.float64]:
        """Return the parameters (n + m,) of the closed door, as seen before the robot hid it."""
        hidden = math.inf if self._looking.carries_camera else self._settings.hidden_distance
        before = self._memory.recall(state.robot, hidden)
        try:
            seen = self._door.values(self._commands.now())
            if before is not None and self._is_another(seen, before.values):
                before = None
        except DoorError as error:
            if before is None or not before.interrupted or error.reason not in HIDDEN:
                raise
        if before is not None:
            self._commands.tell("relying on where the door was before the robot drove up to it")
            return before.values
        values, hinge = seen, self._door.hinge
        if not math.isfinite(hinge):  # as it stands
            hinge = self._hinge_of(seen, state, closed)
            values = when_closed(self._model, seen, hinge)
        # What is beside it may be hidden from then on, too.
        self._others.forget_older(self._commands.now(), self._door.settings.max_age)
        self._memory.keep(values, state.robot, state.time)
        self._held.see(values, hinge)
        return values

    def _hinge_of(
        self, seen: NDArray[np.float64], state: WorldState, closed: NDArray[np.float64] | None
    ) -> float:
        """Return the hinge angle (rad) of a door as it is seen; one not known before is closed."""
        if self._watch.tells_door:
            return state.hinge
        if closed is None or self._is_another(seen, closed):
            return 0.0
        return swung(self._model, closed, seen)

    def _is_another(self, seen: NDArray[np.float64], before: NDArray[np.float64]) -> bool:
        """Tell whether parameters (n + m,) are of another door: hinges stay where they are."""
        return hinge_distance(self._model, seen, before) > self._settings.door_distance

    def _plan(self, values: NDArray[np.float64], goal: Goal) -> Plan:
        state = self._robot.state()
        self._robot.report(PhaseName.PLAN, 0.0, state)
        self._attempts += 1
        theta, gamma = self._model.split(values)
        request = PlanRequest(
            theta=theta,
            gamma=gamma,
            start=state.robot,
            object_start=np.array([state.hinge, state.handle]),
            unlatched=goal.unlatched,
            target=goal.target,
            obstacles=(*self._surroundings(gamma), *self._others.around(self._model, values)),
        )
        try:
            plan = self._planner.plan(request, lambda: self._client.interruption() is not None)
        except PlanningCancelled:
            self._robot.go_on()
            raise
        except PlanningFailed as error:
            raise SkillError("no_plan", f"there is no plan: {error}") from error
        self._plan_report = plan.report
        self._commands.show(plan, values)
        return plan

    def _surroundings(self, gamma: NDArray[np.float64]) -> tuple[Obstacle, ...]:
        """Return the wall around a door of configuration parameters (m,)."""
        if self._settings.surroundings != WALL:
            return ()
        seen = self._door.recess
        recess = seen if math.isfinite(seen) else self._settings.recess
        return wall_around(self._model.body(self._action.joint.body), gamma, recess, self._wall)
