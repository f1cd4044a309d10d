"""The robot of the simulator: what its model lacks, from ``config/robots/NAME.yaml``."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, NamedTuple

from pydantic import Field

from kmn_perception.configuration import resources
from kmn_perception.configuration.node_parameters import load_node_parameters
from kmn_perception.configuration.robot_parts import (
    BaseSettings,
    ControllerSettings,
    Gripper,
    controllers_fault,
    joints_in_messages,
)
from kmn_perception.configuration.section import ConfigurationError
from kmn_perception.configuration.settings import (
    Fraction,
    NonNegative,
    Positive,
    load_settings,
)
from kmn_sim.control.gripper_goal import GripperTolerances
from kmn_sim.control.velocity_controller import VelocityLimits

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


class LinkSettings(NamedTuple):
    """Mass (kg) and inertia (kg m^2) of a link that has no shape."""

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
    gripper_action
        When a gripper that takes commands is where it should be, or stalled.
    velocity_control
        Of a base that takes velocities.
    base
        The links between the base's joints.
    masses
        Of what a joint carries, kg, where the model has none.
    """

    position_gain: Fraction
    follower_effort: NonNegative
    friction: NonNegative
    spinning_friction: NonNegative
    gripper_action: GripperTolerances
    velocity_control: VelocityLimits
    base: LinkSettings
    colours: Colours
    masses: dict[str, Positive] = {}


@dataclass(frozen=True)
class RobotSettings:
    """A robot with a base that moves in the plane, an arm and a gripper.

    Attributes
    ----------
    name, source
        Of the model, and its file in the folder of robotic's models.
    notice
        Where the model comes from, and its licence.
    camera
        The one that it carries, of ``config/cameras``.
    joints
        Movable joints by name, in the order of ``joint_states``: base x, y and yaw first.
    continuous
        Names of those of which a whole turn changes nothing.
    controllers
        By name; each joint has one.
    simulation
        What only the simulator reads.
    planning
        What only the planner reads.
    """

    name: str
    source: str
    notice: str
    camera: str
    base: BaseSettings
    joints: Annotated[dict[str, Motor], Field(min_length=BASE_SIZE)]
    continuous: tuple[str, ...]
    controllers: dict[str, ControllerSettings]
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
    def told_names(self) -> tuple[str, ...]:
        """Names of the joints that trajectories and ``joint_states`` are of."""
        return joints_in_messages(self.joints, self.controllers)

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

    def error(self, text: str) -> ConfigurationError:
        """Return the error that says what is wrong with this robot's file."""
        return ConfigurationError(f"robot '{self.name}': {text}")

    @classmethod
    def load(cls, name_or_path: str | Path = "") -> RobotSettings:
        """Read ``config/robots/NAME.yaml`` or the user's own file; sim_node's where none is told.

        Raises
        ------
        FileNotFoundError, ConfigurationError
            If there is no such file, or it is wrong.
        """
        default = load_node_parameters("sim_node")["robot"].default
        file = resources.find("config/robots", name_or_path or default)
        settings = load_settings(cls, file)
        if settings.gripper.joint not in settings.joints:
            raise ConfigurationError(
                f"{file.name}: gripper: 'joint' must be one of {', '.join(settings.joints)}, "
                f"found {settings.gripper.joint!r}"
            )
        fault = controllers_fault(
            settings.controllers,
            settings.joints,
            settings.base_names,
            settings.gripper.joint,
            settings.base.kind == "fixed",
        )
        if fault:
            raise ConfigurationError(f"{file.name}: {fault}")
        if tuple(settings.base.limits) != settings.base_names:
            raise ConfigurationError(
                f"{file.name}: base: 'limits' must be of the first joints, "
                f"{', '.join(settings.base_names)}, found {', '.join(settings.base.limits)}"
            )
        return settings
