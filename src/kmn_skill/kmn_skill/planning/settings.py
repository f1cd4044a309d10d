"""Numbers of the skill, read from ``config/skill/policy.yaml``."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, NamedTuple

from pydantic import Field

from kmn_perception.configuration import resources
from kmn_perception.configuration.settings import (
    Count,
    Fraction,
    NonNegative,
    Positive,
    load_settings,
)
from kmn_skill.planning.surroundings import SurroundingsSettings


class PolicySettings(NamedTuple):
    """Targets and weights of the policy's features.

    Attributes
    ----------
    pre_grasp
        Place of the gripper before what it grasps, metres from the grasp along x.
    margin
        Distance between what must not touch, metres.
    pressed, relaxed
        Part of the last phase in which a latch stays pressed, and the part of its way that is left
        at the end.
    weights
        Of the features, by name.
    """

    pre_grasp: float
    margin: NonNegative
    pressed: Fraction
    relaxed: Fraction
    weights: dict[str, NonNegative]


class PlannerSettings(NamedTuple):
    """How a plan is made.

    Attributes
    ----------
    coarse, fine
        Configurations in a phase of the first and of the final solution.
    release
        Configurations in which the hand lets go of the handle, and in which it draws back.
    near_guess, near
        Pairs that are further apart in the first guess are left out in the first solution, and
        those further apart in that one in the final solution, metres.
    attempts, spread
        Number of first guesses for each offset of the grasp, and the standard deviation (m and rad)
        by which they vary.
    noise
        Standard deviation of what is added to the first guess, m and rad.
    violation
        Of the constraints; above it the first solution is given up.
    attempt_limit, start_limit
        Seconds for one first guess, and for the planner's process to start.
    """

    coarse: Annotated[int, Field(ge=3, le=100)]
    fine: Annotated[int, Field(ge=3, le=1000)]
    release: Annotated[int, Field(ge=3, le=1000)]
    near_guess: NonNegative
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
    step
        Longest time between two waypoints of a motion, seconds.
    smoothing
        In which an acceleration changes from one limit to the other at the fastest, seconds.
    approach_speed, held_speed
        Largest speed of the hand near the handle, and while it holds it, m/s.
    moved_speed, latch_speed
        Largest speeds of the object's joint that is moved, and of the one that unlatches it, rad/s
        or m/s.
    dwell
        In which the gripper closes, at least, seconds.
    """

    step: Positive
    smoothing: Positive
    approach_speed: Positive
    held_speed: Positive
    moved_speed: Positive
    latch_speed: Positive
    dwell: Positive


class CheckSettings(NamedTuple):
    """What a plan must fulfil, SI units, and how finely it is looked at.

    Attributes
    ----------
    contact, clearance, angle, start
        Largest contact error, smallest clearance, and tolerances of targets and start.
    unlatched
        How far an object is open at least before its latch is let up.
    duration
        Of the longest motion.
    samples
        Looked at between two configurations.
    spacing
        Between the points of the robot's surface.
    """

    contact: NonNegative
    clearance: NonNegative
    angle: NonNegative
    unlatched: NonNegative
    start: NonNegative
    duration: Positive
    samples: Annotated[Count, Field(le=20)]
    spacing: Annotated[float, Field(ge=1e-3, le=0.1)]


@dataclass(frozen=True, eq=False)
class SkillSettings:
    """All of the file.

    Attributes
    ----------
    solver
        Options of the augmented Lagrangian, by their names.
    surroundings
        The wall around a door, where there is one.
    """

    policy: PolicySettings
    planner: PlannerSettings
    solver: dict[str, int | float]
    timing: TimingSettings
    check: CheckSettings
    surroundings: SurroundingsSettings

    @classmethod
    def load(cls, name_or_path: str | Path = "policy") -> SkillSettings:
        """Read ``config/skill/NAME.yaml`` or the user's own file.

        Raises
        ------
        FileNotFoundError, ConfigurationError
            If there is no such file, or it is wrong.
        """
        return load_settings(cls, resources.find("config/skill", name_or_path))
