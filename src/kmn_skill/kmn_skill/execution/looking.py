"""Where a robot drives to see a door, or its handle, better than from where it is."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from kmn_skill.execution.errors import DoorError, SkillError, UncertainDoorError
from kmn_skill.execution.following import RobotFollowing
from kmn_skill.execution.goal import Commands
from kmn_skill.execution.knowledge import Knowledge
from kmn_skill.execution.opening_settings import OpeningSettings
from kmn_skill.execution.states import WorldState
from kmn_skill.planning.look import before_door
from kmn_skill.planning.plan import Plan, PlanningFailed
from kmn_skill.planning.planner import Planner


class Looking:
    """The looks of one goal.

    Parameters
    ----------
    knowledge
        Of the world.
    planner, commands
        What plans and what moves.
    robot
        Of the goal.
    settings
        From where it may look, and how often.
    """

    def __init__(
        self,
        knowledge: Knowledge,
        planner: Planner,
        commands: Commands,
        robot: RobotFollowing,
        settings: OpeningSettings,
    ) -> None:
        self._model, self._door, self._memory = knowledge.model, knowledge.door, knowledge.memory
        self._planner, self._commands, self._robot = planner, commands, robot
        self._settings = settings
        self._drew_back = False
        self._looked: list[float] = []  # metres from the door
        self._no_nearer = ""  # why it does not look from nearer
        self._since = 0.0  # when it came to where it looks from, seconds

    @property
    def carries_camera(self) -> bool:
        """Whether the robot sees the door better from elsewhere."""
        return self._settings.look_distance > 0.0

    def move_to_see(self, state: WorldState) -> bool:
        """Move once to see the door, or its handle, from elsewhere; tell whether it was needed.

        Each look of a goal is from nearer than the one before, up to ``looks``.

        Raises
        ------
        SkillError
            If the robot cannot go to where it first looks from; also as `RobotFollowing.follow`.
        """
        if not self._planner.drives:
            return False
        now = self._commands.now()
        roughly = self._door.roughly(now)
        if not self._drew_back and self._memory.kept is None and roughly is not None:
            self._drew_back = True
            if self._is_at(roughly, state):
                self._commands.tell("the robot is at the door and may hide it; drawing back")
                self._drive(self._way(roughly, self._before(roughly, self._view_distance)))
                return True
        doubt = self._doubt(now)
        if doubt is None or not self._may_look_nearer or self._may_still_learn(now):
            return False
        values, why = doubt
        settings, count = self._settings, len(self._looked)
        distance = settings.look_distance * settings.look_nearer**count
        self._commands.tell(f"{why}; looking from near, {distance:.2f} m before the door")
        try:
            way = self._way(values, self._before(values, distance))
        except SkillError as error:
            if not count:
                raise
            self._no_nearer = str(error)
            return False
        self._looked.append(distance)
        self._drive(way)
        return True

    def again(self, values: NDArray[np.float64]) -> None:
        """Draw back from a door of parameters (n + m,) to where it was seen from, or before it."""
        kept = self._memory.kept
        self._drew_back, self._no_nearer = False, ""
        self._looked = [self._settings.look_distance] if self.carries_camera else []
        if kept is None or self.carries_camera:
            place = self._before(values, self._view_distance)
        else:
            place = kept.robot
        self._drive(self._way(values, place))

    def reason(self, error: DoorError) -> DoorError:
        """Return why a door is not to be relied on, with from where it was looked at in vain."""
        if not self._looked:
            return error
        places = ", ".join(f"{distance:.2f}" for distance in self._looked)
        nearer = f"; {self._no_nearer}" if self._no_nearer else ""
        return DoorError(error.reason, f"{error}; looked from {places} m before it{nearer}")

    @property
    def _view_distance(self) -> float:
        """Metres from the door at which the robot does not hide it."""
        return self._settings.look_distance or self._settings.retreat_distance

    @property
    def _may_look_nearer(self) -> bool:
        in_reach = self.carries_camera and not self._no_nearer
        return in_reach and len(self._looked) < self._settings.looks

    def _may_still_learn(self, now: float) -> bool:
        """Tell whether it has only just begun to look: with more frames a door is known better."""
        return bool(self._looked) and now < self._since + self._settings.look_patience

    def _doubt(self, now: float) -> tuple[NDArray[np.float64], str] | None:
        """Return parameters (n + m,) of a door that is to be seen from nearer, and why."""
        unseen = self._door.without_handle(now)
        if unseen is not None:
            return unseen, "no handle to grasp is seen from here"
        try:
            values = self._door.values(now)
        except UncertainDoorError as error:
            return error.values, str(error)
        except DoorError:
            return None
        if self._settings.look_first and not self._looked:
            return values, "the door was seen from afar"
        return None

    def _is_at(self, values: NDArray[np.float64], state: WorldState) -> bool:
        """Tell whether the robot is at a door of parameters (n + m,)."""
        try:
            reach = self._planner.reach(values, state.robot)
        except PlanningFailed as error:
            raise SkillError("no_plan", str(error)) from error
        return reach > -self._settings.look_clearance

    def _before(self, values: NDArray[np.float64], distance: float) -> NDArray[np.float64]:
        """Return where (J,) the robot stands so far (m) before a door of parameters (n + m,)."""
        return before_door(self._model, values, self._robot.state().robot, distance)

    def _way(self, values: NDArray[np.float64], place: NDArray[np.float64]) -> Plan:
        """Return the plan to positions (J,) from where a door of parameters (n + m,) is seen."""
        start = self._robot.state().robot
        try:
            return self._planner.look(values, start, place, self._settings.look_clearance)
        except PlanningFailed as error:
            raise SkillError("no_plan", str(error)) from error

    def _drive(self, way: Plan) -> None:
        self._robot.follow(way)
        self._since = self._commands.now()
        self._door.forget(self._since)  # what it hid on the way
