"""Settings of the experiment, from ``config/skill/experiment.yaml``."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from kmn_perception.configuration import resources
from kmn_perception.configuration.section import ConfigurationError
from kmn_perception.configuration.settings import (
    Fraction,
    Interval,
    NonNegative,
    Positive,
    load_settings,
)
from kmn_perception.model.actions import Action
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_skill.execution.goal import Goal
from kmn_skill.experiments.beside import Row
from kmn_skill.planning.plan import PlanRequest
from kmn_skill.planning.planning_setup import PlanningSetup
from kmn_skill.planning.prototypes import PULL, PUSH
from kmn_skill.planning.robot import default_robot
from kmn_skill.planning.surroundings import Obstacle, wall_around

MODES = {PULL: -1.0, PUSH: 1.0}  # and the sign of the door's angle


class Pace(NamedTuple):
    """Simulated seconds in one second at most, and the camera's frames a simulated second."""

    real_time_factor: NonNegative
    camera_rate: NonNegative


class Timeouts(NamedTuple):
    """Seconds to wait for something.

    Attributes
    ----------
    start
        For the nodes to start.
    scene, goal
        For a door to be seen, and to be opened.
    server
        For an action's server to be found.
    """

    start: NonNegative
    scene: NonNegative
    goal: NonNegative
    server: NonNegative


class Recording(NamedTuple):
    """Pictures a simulated second, and pictures of a strip."""

    rate: Annotated[float, Field(ge=1.0)]
    strip: Annotated[int, Field(ge=1, le=20)]


class WalledDoor(NamedTuple):
    """A door in a wall.

    Attributes
    ----------
    gamma
        Configuration parameters by name that are not the prototype's.
    recess
        Of the panel, metres.
    kept
        Whether its solution is kept.
    """

    gamma: dict[str, float]
    recess: NonNegative
    kept: bool = False


class WalledGuesses(NamedTuple):
    """How doors in walls are solved for.

    Attributes
    ----------
    doors
        Of which each is solved from the solution of the one before, the first from random guesses.
    tries
        Number of these guesses.
    sides
        Between which the base stands at the handle in them, metres along y.
    """

    doors: Annotated[tuple[WalledDoor, ...], Field(min_length=1)]
    tries: Annotated[int, Field(ge=1)]
    sides: Interval


class PrototypeGuesses(NamedTuple):
    """Guesses from which the policy is solved without a prototype's solution.

    Attributes
    ----------
    side
        Where the base stands at the handle, metres along y.
    spread
        Standard deviation of the arm, radians.
    walled
        For doors that are pushed in a wall.
    """

    side: float
    spread: NonNegative
    walled: WalledGuesses


class RoomDoors(NamedTuple):
    """Doors in rooms: their kinematic model, and limits of what is drawn, metres and radians."""

    model: str
    limits: dict[str, Interval]


class Experiment(NamedTuple):
    """What is done with each object.

    Attributes
    ----------
    model
        Kinematic model of doors that stand alone.
    room
        Doors that stand in rooms.
    row
        Objects with others beside them.
    opened
        Part of its target from which on an object counts as open.
    evaluation, real_time, demo
        How fast each of them runs: evaluations, those whose times are looked at, and the demo.
    faults
        Parameters of sim_node where nothing is quite as it is told.
    timeouts, recording
        How long to wait for what, and what is recorded.
    prototypes
        How the solutions are made that plans start from.
    """

    model: str
    room: RoomDoors
    row: Row
    opened: Fraction
    evaluation: Pace
    real_time: Pace
    faults: dict[str, Positive]
    demo: Pace
    timeouts: Timeouts
    recording: Recording
    prototypes: PrototypeGuesses

    @classmethod
    def load(cls) -> Experiment:
        """Read the file; raise ``ConfigurationError`` if it is wrong."""
        return load_settings(cls, resources.find("config/skill", "experiment"))

    def stands_in_room(self, options: argparse.Namespace) -> bool:
        """Tell whether what is to be opened does: as it is asked for, or a door with walls."""
        return options.room or options.object == self.room.model

    def kinematic_model(self, name: str | Path = "", in_room: bool = False) -> KinematicModel:
        """Load the model of a name, by default that of doors that stand alone, or in rooms.

        Raises
        ------
        ConfigurationError
            If another object than a door is to stand in a room.
        """
        if in_room and name not in ("", self.room.model):
            raise ConfigurationError(
                f"rooms are for '{self.room.model}', not for '{name}': leave one of them out"
            )
        return KinematicModel.load(self.model_file(name, in_room))

    def model_file(self, name: str | Path = "", in_room: bool = False) -> Path:
        """Return the file of the model that `kinematic_model` loads."""
        return resources.find("config/models", self.room.model if in_room else name or self.model)

    def random_objects(
        self, model: KinematicModel, in_room: bool, count: int, seed: int, in_row: bool = False
    ) -> NDArray[np.float64]:
        """Return morphing parameters (count, n + m): alone, over the model's whole limits."""
        generator = np.random.default_rng(seed)
        if not in_room and not in_row:
            return model.sample(generator, count)
        narrower = self.room.limits if in_room else self.row.limits
        limits = np.array([narrower.get(each.name, each.limits) for each in model.parameters])
        return generator.uniform(limits[:, 0], limits[:, 1], (count, len(limits)))

    def goal(self, action: Action, mode: str) -> Goal:
        """Return the goal of an action to a side, ``pull`` or ``push``."""
        return Goal(action.unlatched, MODES[mode] * abs(action.target))

    def request(
        self,
        setup: PlanningSetup,
        values: NDArray[np.float64],
        mode: str,
        recess: float | None = None,
    ) -> PlanRequest:
        """Return the request to open a closed door of parameters (n + m,) from the robot's home.

        Parameters
        ----------
        recess
            Of the panel in its wall, metres; None: there is no wall.
        """
        closed, goal = np.zeros(2), self.goal(setup.action, mode)
        theta, gamma = setup.model.split(values)
        around: tuple[Obstacle, ...] = ()
        if recess is not None:
            panel = setup.model.body(setup.action.joint.body)
            around = wall_around(panel, gamma, recess, setup.settings.surroundings)
        start = setup.robot.home
        return PlanRequest(theta, gamma, start, closed, goal.unlatched, goal.target, around)

    def is_open(self, action: Action, mode: str, position: float) -> bool:
        """Tell whether an object whose joint is at a position (m or rad) is open to a side."""
        return MODES[mode] * position >= self.opened * abs(action.target)


def modes_of(action: Action) -> tuple[str, ...]:
    """Return to which sides an action can move its joint, that of its target first."""
    low, high = action.joint.limits
    found = [mode for mode, sign in MODES.items() if low <= sign * abs(action.target) <= high]
    return tuple(sorted(found, key=lambda mode: MODES[mode] * action.target, reverse=True))


def chosen_mode(action: Action, asked: str) -> str:
    """Return the side to which to open: the one that is asked for, else that of the target.

    Raises
    ------
    ConfigurationError
        If the joint does not open to that side.
    """
    modes = modes_of(action)
    if asked and asked not in modes:
        raise ConfigurationError(
            f"the joint '{action.joint.name}' does not open by {asked}, but by {' or '.join(modes)}"
        )
    return asked or modes[0]


def add_mode_option(parser: argparse.ArgumentParser) -> None:
    """Let a program be told the side to which objects are opened."""
    parser.add_argument(
        "--mode",
        choices=tuple(MODES),
        default="",
        help="the side to which it is opened; default that of the target in its model's file",
    )


def add_object_option(parser: argparse.ArgumentParser) -> None:
    """Let a program be told the object."""
    parser.add_argument(
        "--object", default="", help="name in config/models, or a file; default a door"
    )


def add_robot_option(parser: argparse.ArgumentParser) -> None:
    """Let a program be told the robot."""
    parser.add_argument(
        "--robot", default=default_robot(), help="name in config/robots, default %(default)s"
    )


class RecessLimits(NamedTuple):
    """Recesses of the doors in a simulated room, metres."""

    pull: tuple[NonNegative, NonNegative]
    push: tuple[NonNegative, NonNegative]


def random_recesses(mode: str, count: int, seed: int) -> list[float]:
    """Draw the recesses of doors in rooms, metres, within the simulator's limits."""
    file = resources.find("config/simulation", "room")
    limits = load_settings(RecessLimits, file, "recess")
    generator = np.random.default_rng(seed)
    low, high = getattr(limits, mode)
    return [float(generator.uniform(low, high)) for _ in range(count)]
