"""The robot of the simulator: what its model lacks, from ``config/robots/pr2.yaml``."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, NamedTuple

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

Colour = tuple[Fraction, Fraction, Fraction, Fraction]
BASE_SIZE = 3  # the first joints: x, y and yaw of the base


class Motor(NamedTuple):
    """A movable joint.

    Attributes
    ----------
    home
        Where it starts, m or rad.
    effort, velocity
        The largest of its motor, N or N m, m/s or rad/s.
    planned
        The planner's largest velocity and acceleration.
    """

    home: float
    effort: NonNegative
    velocity: NonNegative
    planned: tuple[Positive, Positive]


class Gripper(NamedTuple):
    """The gripper's commanded joint and those that turn with it."""

    joint: str
    followers: tuple[str, ...]


class BaseSettings(NamedTuple):
    """The joints of the base: limits by name (m, rad), and the links between them.

    Attributes
    ----------
    mass, inertia
        Of each of these links, kg and kg m^2.
    """

    limits: dict[str, Interval]
    mass: Positive
    inertia: Positive


class Colours(NamedTuple):
    """RGBA of the meshes; those are dark whose name contains one of ``dark_parts``."""

    light: Colour
    dark: Colour
    dark_parts: tuple[str, ...]


class RobotPhysics(NamedTuple):
    """The robot in the physics.

    Attributes
    ----------
    position_gain
        Part of the position error that a motor takes away in one step.
    follower_effort
        Largest torque that couples the gripper's joints, N m.
    friction, spinning_friction
        Contact of the fingers.
    """

    position_gain: Fraction
    follower_effort: NonNegative
    friction: NonNegative
    spinning_friction: NonNegative
    base: BaseSettings
    colours: Colours


@dataclass(frozen=True)
class RobotSettings:
    """A robot with a base that moves in the plane, an arm and a gripper.

    Attributes
    ----------
    name, source
        Of the model, and its file in the folder of robotic's models.
    base
        The model's one joint of the base.
    joints
        Movable joints by name, in the order of ``joint_states``: base x, y and yaw first.
    simulation
        What only the simulator reads.
    planning
        What only the planner reads.
    """

    name: str
    source: str
    base: str
    joints: Annotated[dict[str, Motor], Field(min_length=BASE_SIZE)]
    gripper: Gripper
    simulation: RobotPhysics
    planning: Any

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the movable joints."""
        return tuple(self.joints)

    @property
    def base_names(self) -> tuple[str, ...]:
        """Names of the joints of the base: x, y and yaw."""
        return self.names[:BASE_SIZE]

    @property
    def arm_names(self) -> tuple[str, ...]:
        """Names of the joints that are neither of the base nor the gripper's."""
        return tuple(name for name in self.names[BASE_SIZE:] if name != self.gripper.joint)

    @property
    def finger_names(self) -> tuple[str, ...]:
        """Names of the gripper's joints, the commanded one first."""
        return (self.gripper.joint, *self.gripper.followers)

    @property
    def home(self) -> dict[str, float]:
        """Positions by name in which all joints start, m and rad."""
        home = {name: motor.home for name, motor in self.joints.items()}
        return home | dict.fromkeys(self.gripper.followers, home[self.gripper.joint])

    @classmethod
    def load(cls) -> RobotSettings:
        """Read ``config/robots/pr2.yaml``; raise ``ConfigurationError`` if it is wrong."""
        file = resources.find("config/robots", "pr2")
        settings = load_settings(cls, file)
        if settings.gripper.joint not in settings.joints:
            raise ConfigurationError(
                f"{file.name}: gripper: 'joint' must be one of {', '.join(settings.joints)}, "
                f"found {settings.gripper.joint!r}"
            )
        if tuple(settings.simulation.base.limits) != settings.base_names:
            raise ConfigurationError(
                f"{file.name}: simulation: base: 'limits' must be of the first joints, "
                f"{', '.join(settings.base_names)}, found "
                f"{', '.join(settings.simulation.base.limits)}"
            )
        return settings
