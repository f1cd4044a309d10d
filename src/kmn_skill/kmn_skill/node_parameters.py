"""The ROS parameters of skill_node; their defaults are in ``config/nodes/skill_node.yaml``."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Any, TypeVar

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.node import Node

from kmn_perception import resources
from kmn_perception.configuration import Section
from kmn_perception.kinematic_model import KinematicModel
from kmn_skill.execution import ExecutionSettings
from kmn_skill.opening import OpeningSettings
from kmn_skill.perceived_door import MOST_FRAMES, DoorSettings
from kmn_skill.settings import SkillSettings
from kmn_skill.states import StateSettings

JOINTS = 2  # hinge and handle

Settings = TypeVar("Settings")


class ParameterError(ValueError):
    """Parameters that are wrong; the text names them and what was expected."""


@dataclass(frozen=True, eq=False)
class NodeSettings:
    """All parameters of skill_node, checked.

    Attributes
    ----------
    model
        Kinematic model of the door.
    world_frame
        Frame that the door must be given in.
    skill
        Settings of the planner.
    door, states, execution, opening
        Settings of the four.
    """

    model: KinematicModel
    world_frame: str
    skill: SkillSettings
    door: DoorSettings
    states: StateSettings
    execution: ExecutionSettings
    opening: OpeningSettings

    @classmethod
    def check(cls, values: Mapping[str, Any]) -> NodeSettings:
        """Check the parameters' values, by name, one by one and together.

        Raises
        ------
        ParameterError, ConfigurationError, FileNotFoundError
            If one is wrong.
        """
        model = KinematicModel.load(values["model"])
        if len(model.joints) != JOINTS:
            raise ParameterError(
                f"'model' must be that of a door with a hinge and a handle, "
                f"'{model.name}' has {len(model.joints)} joints"
            )
        if not values["world_frame"]:
            raise ParameterError("'world_frame' is empty")
        skill = SkillSettings.load()
        planner = skill.planner._replace(time_limit=values["planning_time"])
        return cls(
            model=model,
            world_frame=values["world_frame"],
            skill=replace(skill, planner=planner),
            door=_pick(DoorSettings, values),
            states=_pick(StateSettings, values),
            execution=_pick(ExecutionSettings, values),
            opening=_pick(OpeningSettings, values),
        )


def declare_parameters(node: Node) -> None:
    """Declare all parameters with the defaults of the configuration file.

    Raises
    ------
    ParameterException
        If the user's value of a parameter is of another type or out of its range.
    """
    file = Section.load(resources.find("config/nodes", "skill_node"))
    defaults = file.section("/**").section("ros__parameters")
    defaults.allow(DESCRIPTORS)
    node.declare_parameters(
        "", [(name, defaults.values[name], DESCRIPTORS[name]) for name in DESCRIPTORS]
    )


def read_parameters(node: Node) -> dict[str, Any]:
    """Return the parameters' present values by name."""
    return {name: node.get_parameter(name).value for name in DESCRIPTORS}


def _pick(kind: type[Settings], values: Mapping[str, Any]) -> Settings:
    """Make settings of the parameters that are named as their fields."""
    return kind(**{field.name: values[field.name] for field in fields(kind)})  # type: ignore[arg-type]


def _any(description: str, read_only: bool = False) -> ParameterDescriptor:
    return ParameterDescriptor(description=description, read_only=read_only)


def _real(description: str, low: float, high: float, read_only: bool = False) -> Any:
    limits = FloatingPointRange(from_value=low, to_value=high)
    return ParameterDescriptor(
        description=description, floating_point_range=[limits], read_only=read_only
    )


def _whole(description: str, low: int, high: int) -> ParameterDescriptor:
    limits = IntegerRange(from_value=low, to_value=high, step=1)
    return ParameterDescriptor(description=description, integer_range=[limits])


DESCRIPTORS: dict[str, ParameterDescriptor] = {
    "model": _any(
        "Kinematic model of the door: a shipped name or the path of a YAML file.", read_only=True
    ),
    "world_frame": _any("Frame that the door must be given in.", read_only=True),
    "door_timeout": _real("A goal waits so long for parameters to rely on [s].", 0.0, 600.0),
    "max_age": _real("The newest parameters may be so old [s].", 0.01, 600.0),
    "frames": _whole("So many frames in a row must be usable and agree.", 1, MOST_FRAMES),
    "max_distance": _real("Handle and hinge may differ by it among these frames [m].", 0.0, 1.0),
    "max_angle": _real("The yaw may differ by it among these frames [rad].", 0.0, 1.0),
    "max_handle_std": _real("Largest standard deviation of the handle's position [m].", 0.0, 1.0),
    "max_hinge_std": _real("Largest standard deviation of the hinge's position [m].", 0.0, 1.0),
    "max_yaw_std": _real("Largest standard deviation of the yaw [rad].", 0.0, 1.0),
    "need_covariance": _any("Parameters whose covariance is unknown are refused."),
    "limit_margin": _real(
        "Part of its range by which a parameter may exceed its limits.", 0.0, 1.0
    ),
    "hidden_distance": _real(
        "After driving so far the robot may hide the door: where it was before is relied upon "
        "when it is not seen [m].",
        0.0,
        1000.0,
    ),
    "planning_time": _real("A plan may take so long [s].", 0.1, 600.0, read_only=True),
    "start_delay": _real("From sending the first part of a plan to its start [s].", 0.0, 10.0),
    "part_duration": _real("Time of the plan that a part covers [s].", 0.2, 60.0),
    "part_overlap": _real(
        "A part reaches so far into the next one; the robot stops there if that never comes [s].",
        0.1,
        10.0,
    ),
    "settle_time": _real("After the end all counts as at rest [s].", 0.0, 10.0),
    "state_timeout": _real("Older states of robot or door are lost [s].", 0.05, 60.0),
    "max_speed": _real("Faster joints are those of another world [m/s, rad/s].", 0.1, 100.0),
    "max_jump": _real("What a state may jump beside that [m, rad].", 0.0, 10.0),
    "position_tolerance": _real("Largest tracking error of the base's position [m].", 0.001, 1.0),
    "angle_tolerance": _real("Largest tracking error of yaw and arm [rad].", 0.001, 3.0),
    "handle_slip": _real("The handle may stay so far behind the hand [rad].", 0.01, 1.0),
    "door_slip": _real("The door may stay so far behind the hand [rad].", 0.01, 1.0),
    "retries": _whole("Further attempts if robot or door did not follow.", 0, 20),
    "handle_tolerance": _real("The handle may miss its goal by it [rad].", 0.0, 1.0),
    "door_tolerance": _real("The door may miss its goal by it [rad].", 0.0, 1.0),
}
