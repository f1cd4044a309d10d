"""The planner's robot: its joints and bodies, from ``config/robots/NAME.yaml``."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kmn_perception.configuration import resources
from kmn_perception.configuration.section import Section
from kmn_perception.configuration.settings import NonNegative, Positive, read_settings
from kmn_skill.planning.layout import BASE


class RobotJoint(NamedTuple):
    """A movable joint, in m or rad and seconds.

    Attributes
    ----------
    home
        Where it starts.
    effort, velocity
        The largest ones of its motor, which the simulator needs.
    planned
        Largest velocity and acceleration of a plan.
    """

    home: float
    effort: Positive
    velocity: Positive
    planned: tuple[Positive, Positive]


class Gripper(NamedTuple):
    """The gripper's joint, and the joints that turn with it."""

    joint: str
    followers: tuple[str, ...]


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
    below: float = math.inf
    above: float = -math.inf


class Pad(NamedTuple):
    """The point in the frame of a joint with which a finger touches, metres."""

    joint: str
    point: tuple[float, float, float]


class Pads(NamedTuple):
    """Those of the two fingers."""

    left: Pad
    right: Pad


class RobotShape(NamedTuple):
    """What the planner knows of the robot's shape beside its model.

    Attributes
    ----------
    rounding
        Radius of the corners of the boxes about the bodies, metres.
    bodies
        By name.
    fingers, moving, obstacles
        Names of bodies: fingers may touch what they hold; moving ones, of the arm, must keep
        clear of the robot's own obstacles.
    """

    rounding: NonNegative
    bodies: dict[str, RobotBody]
    pads: Pads
    fingers: tuple[str, ...]
    moving: tuple[str, ...]
    obstacles: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class RobotModel:
    """What the planner knows of a robot.

    Attributes
    ----------
    source
        The model's file in the folder of robotic's models.
    base
        The model's joint of x, y and yaw.
    joints
        By name, in the order of ``joint_states``: base x, y, yaw, arm, gripper.
    """

    name: str
    source: str
    base: str
    joints: dict[str, RobotJoint]
    gripper: Gripper
    planning: RobotShape

    @classmethod
    def load(cls, name_or_path: str | Path) -> RobotModel:
        """Read ``config/robots/NAME.yaml`` or the user's own file.

        Raises
        ------
        FileNotFoundError
            If there is no such file.
        ConfigurationError
            If a key is missing, unknown or wrong, or the joints do not end with the gripper's.
        """
        section = Section.load(resources.find("config/robots", name_or_path))
        # What only the simulator reads.
        own = {key: value for key, value in section.values.items() if key != "simulation"}
        robot = read_settings(cls, Section(own, section.place))
        if robot.joint_names[-1] != robot.gripper.joint:
            raise section.error(
                f"the last joint must be the gripper's, '{robot.gripper.joint}', "
                f"found '{robot.joint_names[-1]}'"
            )
        shape = robot.planning
        for name in (*shape.fingers, *shape.moving, *shape.obstacles):
            if name not in shape.bodies:
                raise section.error(f"planning: there is no body '{name}'")
        return robot

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joints in the order of ``joint_states``."""
        return tuple(self.joints)

    @property
    def model_joints(self) -> tuple[str, ...]:
        """Names of the joints in the model, which has one for the base."""
        return (self.base, *self.joint_names[BASE.stop :])

    @property
    def home(self) -> NDArray[np.float64]:
        """(J,) positions at which the robot starts, m and rad."""
        return np.array([joint.home for joint in self.joints.values()])

    @property
    def limits(self) -> NDArray[np.float64]:
        """(J, 2) largest velocities and accelerations of a plan, m or rad and seconds."""
        return np.array([joint.planned for joint in self.joints.values()])
