"""The planner's robot: its joints and bodies, from ``config/robots/NAME.yaml``."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kmn_perception.configuration import resources
from kmn_perception.configuration.node_parameters import load_node_parameters
from kmn_perception.configuration.robot_parts import (
    BaseSettings,
    ControllerSettings,
    Gripper,
    controllers_fault,
    joints_in_messages,
    velocity_controller,
)
from kmn_perception.configuration.section import Section
from kmn_perception.configuration.settings import NonNegative, Positive, read_settings
from kmn_skill.planning.layout import BASE

Names = tuple[str, ...]
SIMULATED = ("notice", "camera", "simulation")  # what only the simulator reads


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
    """Where the two fingers touch.

    Attributes
    ----------
    forwards
        Whereto the fingers reach, in the frame of the left one's joint.
    width
        Of what touches, across that, metres.
    """

    left: Pad
    right: Pad
    forwards: tuple[float, float, float]
    width: Positive


class Grip(NamedTuple):
    """Positions of the gripper, m or rad: before the grasp, and by how much beyond contact."""

    open: NonNegative
    squeeze: NonNegative


class Collisions(NamedTuple):
    """Names of bodies that must not touch what the robot opens and passes.

    Attributes
    ----------
    door, handle, approach
        Must not touch the panel, the handle, and the handle before the grasp.
    obstacles
        Must not touch what stands around the door.
    blunt
        Thick ones, which must not do so with edges as round as can be either.
    own
        Bodies of the arm, and those that each of them must not touch.
    """

    door: Names
    handle: Names
    approach: Names
    obstacles: Names
    blunt: Names
    own: dict[str, Names]

    def names(self) -> set[str]:
        """Return all names."""
        own = {name for names in self.own.values() for name in names}
        return own.union(self.own, *self[:-1])


class RobotShape(NamedTuple):
    """What the planner knows of the robot's shape beside its model.

    Attributes
    ----------
    rounding
        Radius of the corners of the boxes about the bodies, metres.
    bodies
        By name.
    stance
        Where the base best stands, metres from the grasp along x and y of the object frame.
    fingers, moving, obstacles
        Names of bodies: fingers may touch what they hold; moving ones, of the arm, must keep
        clear of the robot's own obstacles.
    """

    rounding: NonNegative
    bodies: dict[str, RobotBody]
    pads: Pads
    grip: Grip
    stance: tuple[float, float]
    fingers: Names
    moving: Names
    obstacles: Names
    collisions: Collisions


def default_robot() -> str:
    """Return the robot that skill_node has where none is told."""
    return str(load_node_parameters("skill_node")["robot"].default)


@dataclass(frozen=True, eq=False)
class RobotModel:
    """What the planner knows of a robot.

    Attributes
    ----------
    source
        The model's file in the folder of robotic's models.
    joints
        By name, in the order of ``joint_states``: base x, y, yaw, arm, gripper.
    continuous
        Names of joints of which a whole turn changes nothing.
    controllers
        By name; each joint has one.
    """

    name: str
    source: str
    base: BaseSettings
    joints: dict[str, RobotJoint]
    continuous: tuple[str, ...]
    controllers: dict[str, ControllerSettings]
    gripper: Gripper
    planning: RobotShape

    @classmethod
    def load(cls, name_or_path: str | Path = "") -> RobotModel:
        """Read ``config/robots/NAME.yaml`` or the user's own file; skill_node's where none is told.

        Raises
        ------
        FileNotFoundError
            If there is no such file.
        ConfigurationError
            If a key is missing, unknown or wrong, or the joints do not end with the gripper's.
        """
        section = Section.load(resources.find("config/robots", name_or_path or default_robot()))
        own = {key: value for key, value in section.values.items() if key not in SIMULATED}
        robot = read_settings(cls, Section(own, section.place))
        robot._check(section)
        return robot

    def _check(self, section: Section) -> None:
        """Raise `ConfigurationError` if joints or bodies are named that there are not."""
        base, limited = self.joint_names[BASE], tuple(self.base.limits)
        if limited != base:
            raise section.error(
                f"base: 'limits' must be of the first joints, {', '.join(base)}, "
                f"found {', '.join(limited)}"
            )
        if self.joint_names[-1] != self.gripper.joint:
            raise section.error(
                f"the last joint must be the gripper's, '{self.gripper.joint}', "
                f"found '{self.joint_names[-1]}'"
            )
        for name in self.continuous:
            if name not in self.joints:
                raise section.error(f"continuous: there is no joint '{name}'")
        fault = controllers_fault(
            self.controllers, self.joints, base, self.gripper.joint, self.is_fixed
        )
        if fault:
            raise section.error(fault)
        if self.takes_velocities and base[-1] not in self.continuous:
            raise section.error(
                f"continuous: must name '{base[-1]}', which odometry tells within one turn"
            )
        shape = self.planning
        for name in (*shape.fingers, *shape.moving, *shape.obstacles, *shape.collisions.names()):
            if name not in shape.bodies:
                raise section.error(f"planning: there is no body '{name}'")
        moving = (*self.model_joints, *self.gripper.followers)
        carriers = {f"bodies: {name}": body.joint for name, body in shape.bodies.items()}
        carriers |= {"pads: left": shape.pads.left.joint, "pads: right": shape.pads.right.joint}
        for what, joint in carriers.items():
            if joint not in moving:
                raise section.error(f"planning: {what}: there is no joint '{joint}'")

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joints in the order of ``joint_states``."""
        return tuple(self.joints)

    @property
    def told_names(self) -> tuple[str, ...]:
        """Names of the joints that trajectories and ``joint_states`` are of."""
        return joints_in_messages(self.joints, self.controllers)

    @property
    def is_fixed(self) -> bool:
        """Whether the base stands where it is, which transforms tell."""
        return self.base.kind == "fixed"

    @property
    def takes_velocities(self) -> bool:
        """Whether the base is moved by velocities, and odometry tells where it is."""
        return bool(velocity_controller(self.controllers))

    @property
    def model_joints(self) -> tuple[str, ...]:
        """Names of the joints in the model, which has one for the base."""
        return (self.base.frame, *self.joint_names[BASE.stop :])

    @property
    def home(self) -> NDArray[np.float64]:
        """(J,) positions at which the robot starts, m and rad."""
        return np.array([joint.home for joint in self.joints.values()])

    def whole_turns(self, positions: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the turns (J,) that lead from positions (J,) to those nearest to 0, radians.

        Of joints that turn on and on; 0 for others.
        """
        turns = -2.0 * np.pi * np.round(positions / (2.0 * np.pi))
        return np.where(np.isin(self.joint_names, self.continuous), turns, 0.0)

    @property
    def limits(self) -> NDArray[np.float64]:
        """(J, 2) largest velocities and accelerations of a plan, m or rad and seconds."""
        return np.array([joint.planned for joint in self.joints.values()])
