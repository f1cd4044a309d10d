"""Settings of the experiment, from ``config/skill/experiment.yaml``."""

from __future__ import annotations

from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from kmn_perception.configuration import resources
from kmn_perception.configuration.settings import Interval, NonNegative, Positive, load_settings
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_skill.execution.goal import Goal
from kmn_skill.planning.plan import PlanRequest
from kmn_skill.planning.planning_setup import PlanningSetup
from kmn_skill.planning.prototypes import PULL, PUSH
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
    """What is done with each door.

    Attributes
    ----------
    model
        Kinematic model of doors that stand alone.
    room
        Doors that stand in rooms.
    handle_angle, door_angle
        Of the goal, radians; the door's without sign.
    opened
        Angle from which on a door counts as open, radians.
    evaluation, demo
        How fast each of them runs.
    timeouts, recording
        How long to wait for what, and what is recorded.
    prototypes
        How the solutions are made that plans start from.
    """

    model: str
    room: RoomDoors
    handle_angle: float
    door_angle: Positive
    opened: Positive
    evaluation: Pace
    demo: Pace
    timeouts: Timeouts
    recording: Recording
    prototypes: PrototypeGuesses

    @classmethod
    def load(cls) -> Experiment:
        """Read the file; raise ``ConfigurationError`` if it is wrong."""
        return load_settings(cls, resources.find("config/skill", "experiment"))

    def kinematic_model(self, in_room: bool) -> KinematicModel:
        """Load the model of doors that stand in rooms, or alone."""
        return KinematicModel.load(self.room.model if in_room else self.model)

    def random_doors(self, in_room: bool, count: int, seed: int) -> NDArray[np.float64]:
        """Return morphing parameters (count, n + m): alone, over the model's whole limits."""
        model, generator = self.kinematic_model(in_room), np.random.default_rng(seed)
        if not in_room:
            return model.sample(generator, count)
        limits = np.array([self.room.limits[each.name] for each in model.parameters])
        return generator.uniform(limits[:, 0], limits[:, 1], (count, len(limits)))

    def goal(self, mode: str) -> Goal:
        """Return the goal of a mode, ``pull`` or ``push``."""
        return Goal(self.handle_angle, MODES[mode] * self.door_angle)

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
        closed, goal = np.zeros(len(setup.model.joints)), self.goal(mode)
        theta, gamma = setup.model.split(values)
        around: tuple[Obstacle, ...] = ()
        if recess is not None:
            around = wall_around(setup.model, gamma, recess, setup.settings.surroundings)
        return PlanRequest(theta, gamma, setup.robot.home, closed, *goal, around)

    def is_open(self, mode: str, hinge: float) -> bool:
        """Tell whether a door at this hinge angle (rad) is open to the right side."""
        return MODES[mode] * hinge >= self.opened


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
