"""Moves the robot along plans, and knows the state of the world meanwhile."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final

from kmn_skill.execution.errors import ExecutionError
from kmn_skill.execution.goal import Client, Commands, Feedback, Goal
from kmn_skill.execution.knowledge import Knowledge
from kmn_skill.execution.plan_execution import Execution, ExecutionSettings
from kmn_skill.execution.states import WorldState
from kmn_skill.planning.phases import PhaseName
from kmn_skill.planning.plan import Plan

POLL_PERIOD = 0.05  # seconds between two looks for a cancellation
RECENT = 0.2  # seconds; a robot on its way is elsewhere than older states have it
STUCK: Final = "stuck"  # reason of an error
HOLDING = (PhaseName.PRESS, PhaseName.OPEN)  # phases in which the hand holds the handle


class RobotFollowing:
    """The robot of one goal.

    Parameters
    ----------
    knowledge
        Of the world.
    commands, client
        What moves the robot, and who is told.
    settings
        How a plan is followed.

    Attributes
    ----------
    handle, hinge
        Largest angle of the handle so far, and the present one of the hinge, radians.
    tracking_error
        Largest one so far, in units of the tolerances.
    """

    def __init__(
        self,
        knowledge: Knowledge,
        commands: Commands,
        client: Client,
        settings: ExecutionSettings,
    ) -> None:
        self._watch, self._held, self._memory = knowledge.watch, knowledge.held, knowledge.memory
        self._force, self._action = knowledge.force, knowledge.model.actions[0]
        self._commands, self._client, self._settings = commands, client, settings
        self._breaks = self._watch.breaks
        self._followed: Execution | None = None  # while the robot is on its way
        self.handle = self.hinge = math.nan
        self.tracking_error = 0.0

    def begin(self) -> None:
        """Take the world for what it is now; from here on it may not become another one."""
        self._breaks = self._watch.breaks

    def follow(self, plan: Plan) -> None:
        """Send a plan part by part until all is done and at rest.

        Raises
        ------
        InterruptedGoal, StatesError, ExecutionError, ControllerError
            As soon as it cannot be followed; the robot is to be held then.
        """
        execution = Execution(plan, self._commands.now(), self._settings)
        self._followed, finished = execution, False
        while not finished:
            state = self._newest()
            phase, planned = execution.planned(state.time)
            if phase in HOLDING:
                self._held.grasp(state.robot, planned)
            else:
                self._held.let_go()
            self._memory.keep_grip(self._held.grip)
            state = self._with_door(state)
            if phase == PhaseName.OPEN:
                self._check_force(state)
            through = self._commands.are_through()
            part, progress, finished = execution.step(self._commands.now(), state)
            finished &= through
            self.tracking_error = max(self.tracking_error, execution.tracking_error)
            if part is not None:
                self._commands.send(part)
            self.report(phase, progress, state)
            self._watch.wait(POLL_PERIOD)
        self._followed = None

    def reach(self, plan: Plan, check: Callable[[Goal], None]) -> None:
        """Follow a plan, and check where it led; what slips off there and stays has come there.

        So has what can be moved no further there.

        Parameters
        ----------
        check
            Raises ``ExecutionError`` where the positions to which the object came are not enough.

        Raises
        ------
        InterruptedGoal, StatesError, ExecutionError, ControllerError
            As ``follow`` and the check do.
        """
        slip: ExecutionError | None = None
        try:
            self.follow(plan)
        except ExecutionError as error:
            if error.reason not in ("slipped", STUCK):
                raise
            self.hold()
            if error.reason == "slipped" and self._held.falls_shut(self.hinge):
                raise ExecutionError("slipped", f"{error}; it falls shut") from error
            slip = error
        try:
            check(Goal(self.handle, self.hinge))
        except ExecutionError as missed:
            raise slip or missed from None

    def hold(self) -> None:
        """Let the robot hold where it is: where it was just measured, else where it was sent.

        On its way it cannot stop at once: it comes to rest as far ahead as a constant deceleration
        takes it.
        A robot that nobody moves and whose states are lost is left alone.
        """
        now, followed = self._commands.now(), self._followed
        timeout = self._watch.settings.state_timeout if followed is None else RECENT
        measured = self._watch.robot(now, timeout)
        if followed is None:
            if measured is not None:
                self._commands.hold(measured.positions)
            return
        positions = followed.position(now + 0.5 * self._settings.hold_duration)
        if measured is not None:  # by what it misses the plan
            positions += measured.positions - followed.position(measured.time)
        self._commands.hold(positions)
        self._followed = None

    def _check_force(self, state: WorldState) -> None:
        """Raise if what the hand moves takes more force than its file allows."""
        force = self._force.along(self._held.way(state.hinge), state.time)
        joint, limit = self._action.joint, self._action.force_limit
        if force > limit:
            raise ExecutionError(
                STUCK,
                f"the {joint.name} is stuck at {state.hinge:.2f} {joint.unit}: it takes "
                f"{force:.0f} N to move on, expected at most {limit:g} N",
            )

    def state(self) -> WorldState:
        """Return the newest state.

        Raises
        ------
        InterruptedGoal, StatesError
            If the goal ends, or the states cannot be relied upon.
        ExecutionError
            If the handle slipped out of the hand.
        """
        return self._with_door(self._newest())

    def _newest(self) -> WorldState:
        """Return the newest state of the robot, and of the door where it is told."""
        self.go_on()
        return self._watch.newest(self._commands.now(), self._breaks)

    def _with_door(self, state: WorldState) -> WorldState:
        """Return a state with the angles of the door, and keep them."""
        if not self._watch.tells_door:
            state = state._replace(**self._held.angles(state.robot)._asdict())
        self.hinge = state.hinge
        if not abs(state.handle) <= abs(self.handle):
            self.handle = state.handle
        return state

    def go_on(self) -> None:
        """Raise ``InterruptedGoal`` if the goal is not wanted any more."""
        if interruption := self._client.interruption():
            raise interruption

    def report(self, phase: str, progress: float, state: WorldState) -> None:
        """Tell the client what is being done, and how much of it is done, 0 to 1."""
        self._client.feed_back(Feedback(phase, progress, state.handle, state.hinge))
