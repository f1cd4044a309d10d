"""The planner's PR2: which joints and bodies it has, from ``config/skill/pr2.yaml``."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kmn_perception.configuration import resources
from kmn_perception.configuration.section import Section


class Motor(NamedTuple):
    """Largest velocity (m/s or rad/s) and acceleration (m/s^2 or rad/s^2) of a joint."""

    velocity: float
    acceleration: float


class RobotBody(NamedTuple):
    """A rigid part of the robot: meshes of the model that a joint carries.

    Attributes
    ----------
    joint
        Frame of the model that carries it.
    meshes
        Frames of the model whose meshes it consists of.
    below, above
        Heights in the joint's frame between which the meshes count, metres.
    """

    joint: str
    meshes: tuple[str, ...]
    below: float
    above: float


class Pad(NamedTuple):
    """The point (3,) in the frame of a joint with which a finger touches, metres."""

    joint: str
    point: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class RobotModel:
    """What the planner knows of the PR2 beside its model.

    Attributes
    ----------
    source
        The model's file in the folder of robotic's models.
    base
        The model's joint of x, y and yaw.
    motors
        Joints by name, in the order of ``joint_states``: base x, y, yaw, arm, gripper.
    followers
        Joints that turn with the gripper's.
    rounding
        Radius of the corners of the boxes about the bodies, metres.
    """

    source: str
    base: str
    motors: dict[str, Motor]
    followers: tuple[str, ...]
    rounding: float
    bodies: dict[str, RobotBody]
    pads: tuple[Pad, Pad]

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joints in the order of ``joint_states``."""
        return tuple(self.motors)

    @property
    def model_joints(self) -> tuple[str, ...]:
        """Names of the joints in the model, which has one for the base."""
        return (self.base, *self.joint_names[3:])

    @property
    def gripper(self) -> str:
        """Name of the gripper's joint."""
        return self.joint_names[-1]

    @classmethod
    @cache
    def load(cls) -> RobotModel:
        """Read the configuration file."""
        section = Section.load(resources.find("config/skill", "pr2"))
        section.allow(
            ("name", "source", "base", "joints", "followers", "rounding", "bodies", "pads")
        )
        joints, bodies, pads = (section.section(key) for key in ("joints", "bodies", "pads"))
        pads.allow(("left", "right"))
        return cls(
            source=section.text("source"),
            base=section.text("base"),
            motors={name: _motor(joints.section(name)) for name in joints.values},
            followers=tuple(section.values["followers"]),
            rounding=section.number("rounding", 0.0),
            bodies={name: _body(bodies.section(name)) for name in bodies.values},
            pads=(_pad(pads.section("left")), _pad(pads.section("right"))),
        )


def _motor(section: Section) -> Motor:
    section.allow(("velocity", "acceleration"))
    return Motor(section.number("velocity", 0.0), section.number("acceleration", 0.0))


def _body(section: Section) -> RobotBody:
    section.allow(("joint", "meshes"), ("below", "above"))
    return RobotBody(
        section.text("joint"),
        tuple(section.values["meshes"]),
        section.number("below") if "below" in section else math.inf,
        section.number("above") if "above" in section else -math.inf,
    )


def _pad(section: Section) -> Pad:
    section.allow(("joint", "point"))
    return Pad(section.text("joint"), np.array(section.numbers("point", 3)))
