"""The ROS parameters of skill_node; their defaults are in ``config/nodes/skill_node.yaml``."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from rcl_interfaces.msg import ParameterDescriptor

from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.ros.parameters import ParameterError, anything, pick, real, whole
from kmn_skill.execution.opening import OpeningSettings
from kmn_skill.execution.perceived_door import MAX_FRAMES, AcceptanceSettings
from kmn_skill.execution.plan_execution import ExecutionSettings
from kmn_skill.execution.states import StateSettings

JOINTS = 2  # hinge and handle


@dataclass(frozen=True, eq=False)
class SkillNodeSettings:
    """All parameters of skill_node, checked.

    Attributes
    ----------
    model
        Kinematic model of the door.
    world_frame
        Frame that the door must be given in.
    planning_time
        Seconds for a plan.
    door, states, execution, opening
        Settings of the four.
    """

    model: KinematicModel
    world_frame: str
    planning_time: float
    door: AcceptanceSettings
    states: StateSettings
    execution: ExecutionSettings
    opening: OpeningSettings

    @classmethod
    def check(cls, values: Mapping[str, Any]) -> SkillNodeSettings:
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
        return cls(
            model=model,
            world_frame=values["world_frame"],
            planning_time=values["planning_time"],
            door=pick(AcceptanceSettings, values),
            states=pick(StateSettings, values),
            execution=pick(ExecutionSettings, values),
            opening=pick(OpeningSettings, values),
        )


DESCRIPTORS: dict[str, ParameterDescriptor] = {
    "model": anything(
        "Kinematic model of the door: a shipped name or the path of a YAML file.", read_only=True
    ),
    "world_frame": anything("Frame that the door must be given in.", read_only=True),
    "door_timeout": real("A goal waits so long for parameters to rely on [s].", 0.0, 600.0),
    "max_age": real("The newest parameters may be so old [s].", 0.01, 600.0),
    "frames": whole("So many frames in a row must be usable and agree.", 1, MAX_FRAMES),
    "max_distance": real("Handle and hinge may differ by it among these frames [m].", 0.0, 1.0),
    "max_angle": real("The yaw may differ by it among these frames [rad].", 0.0, 1.0),
    "max_handle_std": real("Largest standard deviation of the handle's position [m].", 0.0, 1.0),
    "max_hinge_std": real("Largest standard deviation of the hinge's position [m].", 0.0, 1.0),
    "max_yaw_std": real("Largest standard deviation of the yaw [rad].", 0.0, 1.0),
    "need_covariance": anything("Parameters whose covariance is unknown are refused."),
    "limit_margin": real("Part of its range by which a parameter may exceed its limits.", 0.0, 1.0),
    "hidden_distance": real(
        "A robot that drove so far since it saw the door hides it: where it was before is relied "
        "upon [m].",
        0.0,
        1000.0,
    ),
    "planning_time": real("A plan may take so long [s].", 0.1, 600.0, read_only=True),
    "start_delay": real("From sending the first part of a plan to its start [s].", 0.0, 10.0),
    "part_duration": real("Time of the plan that a part covers [s].", 0.2, 60.0),
    "part_overlap": real(
        "A part reaches so far into the next one; the robot stops there if that never comes [s].",
        0.1,
        10.0,
    ),
    "settle_time": real("After the end all counts as at rest [s].", 0.0, 10.0),
    "state_timeout": real("Older states of robot or door are lost [s].", 0.05, 60.0),
    "max_speed": real("Faster joints are those of another world [m/s, rad/s].", 0.1, 100.0),
    "max_jump": real("What a state may jump beside that [m, rad].", 0.0, 10.0),
    "position_tolerance": real("Largest tracking error of the base's position [m].", 0.001, 1.0),
    "angle_tolerance": real("Largest tracking error of yaw and arm [rad].", 0.001, 3.0),
    "handle_slip": real("The handle may stay so far behind the hand [rad].", 0.01, 1.0),
    "door_slip": real("The door may stay so far behind the hand [rad].", 0.01, 1.0),
    "retries": whole("Further attempts if robot or door did not follow.", 0, 20),
    "handle_tolerance": real("The handle may miss its goal by it [rad].", 0.0, 1.0),
    "door_tolerance": real("The door may miss its goal by it [rad].", 0.0, 1.0),
}
