"""Numbers of the skill, read from ``config/skill/door.yaml``."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal, NamedTuple

from pydantic import Field

from kmn_perception.configuration import resources
from kmn_perception.configuration.settings import Count, NonNegative, Positive, load_settings
from kmn_skill.planning.surroundings import SurroundingsSettings

Names = tuple[str, ...]


class GraspSettings(NamedTuple):
    """Where the handle is grasped.

    Attributes
    ----------
    body
        Body of the kinematic model.
    offset
        From the body's centre, metres in the object frame.
    axis
        Along which the two points lie on the body's surface.
    """

    body: str
    offset: tuple[float, float, float]
    axis: Literal["x", "y", "z"]


class PolicySettings(NamedTuple):
    """Targets and weights of the policy's features.

    Attributes
    ----------
    base
        Place of the base from the grasp, metres along x and y of the object frame.
    pre_grasp
        Place of the gripper before the handle, metres from the grasp along x.
    open_gripper
        Gripper's position before the grasp, radians.
    margin
        Distance between what must not touch, metres.
    weights
        Of the features, by name.
    door_collisions, handle_collisions, approach_collisions
        Bodies of the robot that must not touch panel or handle, the last ones before the handle.
    obstacle_collisions
        Bodies of the robot that must not touch what stands around the door.
    blunt_collisions
        Bodies that are thick, and must not do so with edges as round as can be either.
    self_collisions
        Bodies of the arm, and those that each of them must not touch.
    """

    base: tuple[float, float]
    pre_grasp: float
    open_gripper: NonNegative
    margin: NonNegative
    weights: dict[str, NonNegative]
    door_collisions: Names
    handle_collisions: Names
    approach_collisions: Names
    obstacle_collisions: Names
    blunt_collisions: Names
    self_collisions: dict[str, Names]


class PlannerSettings(NamedTuple):
    """How a plan is made.

    Attributes
    ----------
    coarse, fine
        Configurations in a phase of the first and of the final solution.
    release
        Configurations in which the hand lets go of the handle, and in which it draws back.
    near
        Pairs that are further apart in the first solution are left out in the final one, metres.
    attempts, spread
        Number of first guesses, and the standard deviation (m and rad) by which they vary.
    noise
        Standard deviation of what is added to what the solver starts from, m and rad.
    violation
        Of the constraints; above it the first solution is given up.
    attempt_limit, start_limit
        Seconds for one first guess, and for the planner's process to start.
    """

    coarse: Annotated[int, Field(ge=3, le=100)]
    fine: Annotated[int, Field(ge=3, le=1000)]
    release: Annotated[int, Field(ge=3, le=1000)]
    near: NonNegative
    attempts: Annotated[int, Field(ge=1, le=100)]
    spread: NonNegative
    noise: NonNegative
    violation: NonNegative
    attempt_limit: NonNegative
    start_limit: NonNegative


class TimingSettings(NamedTuple):
    """Times of a plan.

    Attributes
    ----------
    min_step
        Shortest time between two configurations, seconds.
    dwell
        In which the gripper closes, seconds.
    squeeze
        By which the gripper is sent beyond contact, radians.
    """

    min_step: Positive
    dwell: Positive
    squeeze: NonNegative


class CheckSettings(NamedTuple):
    """What a plan must fulfil, SI units, and how finely it is looked at.

    Attributes
    ----------
    contact, clearance, angle, start
        Largest contact error, smallest clearance, and tolerances of targets and start.
    samples
        Looked at between two configurations.
    spacing
        Between the points of the robot's surface.
    """

    contact: NonNegative
    clearance: NonNegative
    angle: NonNegative
    start: NonNegative
    samples: Annotated[Count, Field(le=20)]
    spacing: Annotated[float, Field(ge=1e-3, le=0.1)]


@dataclass(frozen=True, eq=False)
class SkillSettings:
    """All of the file.

    Attributes
    ----------
    robot
        The robot that the policy is for: a name in ``config/robots``.
    solver
        Options of the augmented Lagrangian, by their names.
    surroundings
        The wall around the door, where there is one.
    """

    robot: str
    grasp: GraspSettings
    policy: PolicySettings
    planner: PlannerSettings
    solver: dict[str, int | float]
    timing: TimingSettings
    check: CheckSettings
    surroundings: SurroundingsSettings

    @classmethod
    def load(cls, name_or_path: str | Path = "door") -> SkillSettings:
        """Read ``config/skill/NAME.yaml`` or the user's own file.

        Raises
        ------
        FileNotFoundError, ConfigurationError
            If there is no such file, or it is wrong.
        """
        return load_settings(cls, resources.find("config/skill", name_or_path))
