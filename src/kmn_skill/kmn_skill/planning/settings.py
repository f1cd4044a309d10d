"""Numbers of the skill, read from ``config/skill/door.yaml``."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kmn_perception.configuration import resources
from kmn_perception.configuration.section import Section, is_number

AXES = ("x", "y", "z")


class GraspSettings(NamedTuple):
    """Where the handle is grasped.

    Attributes
    ----------
    body
        Body of the kinematic model.
    offset
        (3,) from the body's centre, metres in the object frame.
    axis
        Number of the axis along which the two points lie on the body's surface.
    """

    body: str
    offset: NDArray[np.float64]
    axis: int


class PolicySettings(NamedTuple):
    """Targets and weights of the policy's features.

    Attributes
    ----------
    base
        (2,) place of the base from the grasp, metres in the object frame.
    pre_grasp
        Place of the gripper before the handle, metres from the grasp along x.
    open_gripper
        Gripper's angle before the grasp, radians.
    margin
        Distance between what shall not touch, metres.
    weights
        Of the features, by name.
    door_collisions, handle_collisions, approach_collisions
        Bodies of the robot that shall not touch panel or handle, the last ones before the handle.
    self_collisions
        Bodies of the arm, and those that each of them shall not touch.
    """

    base: tuple[float, ...]
    pre_grasp: float
    open_gripper: float
    margin: float
    weights: dict[str, float]
    door_collisions: tuple[str, ...]
    handle_collisions: tuple[str, ...]
    approach_collisions: tuple[str, ...]
    self_collisions: dict[str, tuple[str, ...]]


class PlannerSettings(NamedTuple):
    """How a plan is made.

    Attributes
    ----------
    coarse, fine
        Configurations a phase of the first and of the final solution.
    release
        Configurations in which the hand lets go of the handle, and in which it draws back.
    near
        Pairs that are further apart in the first solution are left out in the final one, metres.
    attempts, spread
        First guesses, and the standard deviation (m and rad) by which they vary.
    noise
        Standard deviation of what is added to what the solver starts from, m and rad.
    violation
        Of the constraints, above which the first solution is given up.
    time_limit, attempt_limit, start_limit
        Seconds for a plan, for one first guess, and for the planner's process to start.
    """

    coarse: int
    fine: int
    release: int
    near: float
    attempts: int
    spread: float
    noise: float
    violation: float
    time_limit: float
    attempt_limit: float
    start_limit: float


class TimingSettings(NamedTuple):
    """Least time of a step, time in which the gripper closes (s), and how far beyond contact."""

    min_step: float
    dwell: float
    squeeze: float


class CheckSettings(NamedTuple):
    """What a plan must fulfil, SI units, and how finely it is looked at.

    Attributes
    ----------
    contact, clearance, angle, start
        Largest contact error, least clearance, and tolerances of targets and start.
    samples
        Looked at between two configurations.
    spacing
        Between the points of the robot's surface.
    stem
        Thickness of the stem between handle and panel.
    """

    contact: float
    clearance: float
    angle: float
    start: float
    samples: int
    spacing: float
    stem: float


@dataclass(frozen=True, eq=False)
class SkillSettings:
    """All of the file; ``solver`` are options of the augmented Lagrangian, by their names."""

    grasp: GraspSettings
    policy: PolicySettings
    planner: PlannerSettings
    solver: dict[str, float]
    timing: TimingSettings
    check: CheckSettings

    @classmethod
    @cache
    def load(cls) -> SkillSettings:
        """Read the configuration file."""
        section = Section.load(resources.find("config/skill", "door"))
        section.allow(("grasp", "policy", "planner", "solver", "timing", "check"))
        return cls(
            grasp=_grasp(section.section("grasp")),
            policy=_policy(section.section("policy")),
            planner=_planner(section.section("planner")),
            solver=_options(section.section("solver")),
            timing=TimingSettings(**_numbers(section.section("timing"), TimingSettings._fields)),
            check=_check(section.section("check")),
        )


def _numbers(section: Section, keys: tuple[str, ...]) -> dict[str, float]:
    section.allow(keys)
    return {key: section.number(key, 0.0) for key in keys}


def _grasp(section: Section) -> GraspSettings:
    section.allow(GraspSettings._fields)
    return GraspSettings(
        section.text("body"),
        np.array(section.numbers("offset", 3)),
        AXES.index(section.text("axis", AXES)),
    )


def _policy(section: Section) -> PolicySettings:
    section.allow(PolicySettings._fields)
    weights = section.section("weights")
    pairs = section.section("self_collisions")
    return PolicySettings(
        base=tuple(section.numbers("base", 2)),
        pre_grasp=section.number("pre_grasp"),
        open_gripper=section.number("open_gripper", 0.0),
        margin=section.number("margin", 0.0),
        weights={name: weights.number(name, 0.0) for name in weights.values},
        door_collisions=_names(section, "door_collisions"),
        handle_collisions=_names(section, "handle_collisions"),
        approach_collisions=_names(section, "approach_collisions"),
        self_collisions={name: _names(pairs, name) for name in pairs.values},
    )


def _names(section: Section, key: str) -> tuple[str, ...]:
    values = section.values.get(key)
    if not isinstance(values, list) or not all(isinstance(value, str) for value in values):
        raise section.error(f"'{key}' must be a list of names, found {values!r}")
    return tuple(values)


def _planner(section: Section) -> PlannerSettings:
    section.allow(PlannerSettings._fields)
    return PlannerSettings(
        coarse=section.whole_number("coarse", 3, 100),
        fine=section.whole_number("fine", 3, 1000),
        release=section.whole_number("release", 3, 1000),
        near=section.number("near", 0.0),
        attempts=section.whole_number("attempts", 1, 100),
        spread=section.number("spread", 0.0),
        noise=section.number("noise", 0.0),
        violation=section.number("violation", 0.0),
        time_limit=section.number("time_limit", 0.0),
        attempt_limit=section.number("attempt_limit", 0.0),
        start_limit=section.number("start_limit", 0.0),
    )


def _options(section: Section) -> dict[str, Any]:
    for key, value in section.values.items():
        if not is_number(value):
            raise section.error(f"'{key}' must be a number, found {value!r}")
    return dict(section.values)


def _check(section: Section) -> CheckSettings:
    section.allow(CheckSettings._fields)
    return CheckSettings(
        contact=section.number("contact", 0.0),
        clearance=section.number("clearance", 0.0),
        angle=section.number("angle", 0.0),
        start=section.number("start", 0.0),
        samples=section.whole_number("samples", 1, 20),
        spacing=section.number("spacing", 1e-3, 0.1),
        stem=section.number("stem", 0.0),
    )
