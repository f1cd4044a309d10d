"""What stands in the world: which object, with which parameters, and what is around it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from kmn_perception.model.actions import Action
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.model.parts import WORLD, Joint
from kmn_sim.robot.settings import RobotSettings
from kmn_sim.world.room import Room, Way
from kmn_sim.world.room_settings import RoomSettings

DIRECTIONS = ("pull", "push")


class ScenarioError(ValueError):
    """A scenario that cannot be built; the text says what is wrong with it."""


@dataclass(frozen=True, eq=False)
class Scenario:
    """An object m(theta, gamma) and its surroundings.

    Attributes
    ----------
    model
        Kinematic model of the object; one with an action is articulated, others are boxes.
    values
        (n + m,) morphing parameters (theta, gamma).
    direction
        Whether an object opens towards the robot (``pull``) or away from it (``push``).
    stem, frame, wall
        Whether a door has a stem between lever and panel, a frame, and a wall around it.
    floor
        Whether there is a floor.
    table
        Whether a box stands on a table; then z = 0 is the table's top.
    room
        That a door stands in, instead of frame and wall alone.
    beside
        Objects that stand in one row with it, see `kmn_sim.world.row.in_row`.
    in_row
        Whether it is one of these: it stands where the row has it, be it beyond its theta's limits.
    """

    model: KinematicModel
    values: NDArray[np.float64]
    direction: str = "pull"
    stem: bool = True
    frame: bool = False
    wall: bool = False
    floor: bool = True
    table: bool = False
    room: Room | None = None
    beside: tuple[Scenario, ...] = ()
    in_row: bool = False

    def __post_init__(self) -> None:
        if self.direction not in DIRECTIONS:
            raise ScenarioError(
                f"'direction' must be one of {', '.join(DIRECTIONS)}, found '{self.direction}'"
            )
        parameters = self.model.parameters
        if self.values.shape != (len(parameters),):
            names = ", ".join(parameter.name for parameter in parameters)
            raise ScenarioError(
                f"model '{self.model.name}' has {len(parameters)} parameters ({names}), "
                f"found {self.values.size} values"
            )
        free = len(self.model.theta) if self.in_row else 0
        for parameter, value in zip(parameters[free:], self.values[free:], strict=True):
            low, high = parameter.limits
            if not low <= value <= high:
                raise ScenarioError(f"{parameter.name} = {value:g} is outside [{low:g}, {high:g}]")
        if self.is_articulated:
            self._check_surroundings()

    def _check_surroundings(self) -> None:
        low, high = self.limits(self.action.joint)
        if low >= high:
            raise ScenarioError(
                f"'direction': model '{self.model.name}' does not open by {self.direction}, its "
                f"joint '{self.action.joint.name}' is limited to {list(self.action.joint.limits)}"
            )
        if (self.frame or self.wall) and not self.fills_opening:
            raise ScenarioError(
                f"'frame' and 'wall' are for doors in a wall, model '{self.model.name}' is none"
            )

    @property
    def is_articulated(self) -> bool:
        """Whether something can be done with the object."""
        return bool(self.model.actions)

    @property
    def fills_opening(self) -> bool:
        """Whether the object is a panel in an opening of a wall: a door."""
        return self.is_articulated and self.action.joint.parent == WORLD

    @property
    def action(self) -> Action:
        """What can be done with an object that is articulated."""
        return self.model.actions[0]

    def limits(self, joint: Joint) -> tuple[float, float]:
        """Return the limits (m or rad) of a joint: what is opened stops where it is closed."""
        low, high = joint.limits
        if joint.name != self.action.joint.name:
            return low, high
        return (low, 0.0) if self.direction == "pull" else (0.0, high)

    @property
    def theta(self) -> NDArray[np.float64]:
        """(n,) transformation parameters."""
        return self.model.split(self.values)[0]

    @property
    def gamma(self) -> NDArray[np.float64]:
        """(m,) configuration parameters."""
        return self.model.split(self.values)[1]


def in_room(
    scenario: Scenario, seed: int, recess: float | None = None, robot: str | Path = ""
) -> Scenario:
    """Return a scenario whose door stands in a room that is drawn by a seed.

    Parameters
    ----------
    recess
        Given instead of drawn, metres.
    robot
        Whose way to the door stays clear, see `RobotSettings.load`.

    Raises
    ------
    ScenarioError
        If the object is no door, or has frame or wall already.
    """
    if not scenario.fills_opening:
        raise ScenarioError(
            f"'room' is for doors in a wall, model '{scenario.model.name}' is none: leave it out"
        )
    if scenario.frame or scenario.wall:
        raise ScenarioError("a 'room' has its own frame and wall: leave 'frame' and 'wall' out")
    settings = RobotSettings.load(robot)
    x, y = (settings.home[name] for name in settings.base_names[:2])
    way = Way.of(scenario.model, scenario.action, scenario.values, (x, y))
    return replace(
        scenario, room=Room.draw(RoomSettings.load(), scenario.direction, seed, way, recess)
    )
