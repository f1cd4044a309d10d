"""The ROS parameters of skill_node, which ``config/nodes/skill_node_parameters.yaml`` states."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from kmn_perception.configuration.node_parameters import ParameterError, pick
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.model.parts import PRISMATIC, Joint
from kmn_skill.execution.base_motion import TrackingSettings
from kmn_skill.execution.held_door import GripSettings
from kmn_skill.execution.opening_settings import OpeningSettings
from kmn_skill.execution.perceived_door import AcceptanceSettings
from kmn_skill.execution.plan_execution import ExecutionSettings
from kmn_skill.execution.states import StateSettings

ENCODERS = "door_state"  # the topic on which somebody tells the door's angles
TOPIC = "topic"  # as which the robot is controlled


@dataclass(frozen=True, eq=False)
class SkillNodeSettings:
    """All parameters of skill_node, checked.

    Attributes
    ----------
    model
        Kinematic model of the door.
    robot
        Its name, or its file.
    world_frame
        Frame that the robot moves in.
    base_frame
        Of a base that stands where it is.
    transform_delay
        Seconds for which a door in another frame waits for its transform.
    planning_time
        Seconds for a plan.
    preempt
        Whether a new goal ends the one that runs.
    control
        Whether the robot is moved by a ``topic`` or by the ``action`` of each controller.
    controller_timeout
        Seconds in which a controller must answer.
    base_rate
        Velocities a second that a base is sent which takes them.
    door_angles
        Who tells the door's angles: `ENCODERS`, or the hand that holds the handle.
    door, states, grip, tracking, execution, opening
        Settings of the six.
    slide_slip, slide_tolerance
        Of what slides, metres, in place of ``door_slip`` and ``door_tolerance``.
    """

    model: KinematicModel
    robot: str
    world_frame: str
    base_frame: str
    transform_delay: float
    planning_time: float
    preempt: bool
    control: str
    controller_timeout: float
    base_rate: float
    door_angles: str
    door: AcceptanceSettings
    states: StateSettings
    grip: GripSettings
    tracking: TrackingSettings
    execution: ExecutionSettings
    opening: OpeningSettings
    slide_slip: float
    slide_tolerance: float

    def of(self, joint: Joint) -> tuple[OpeningSettings, ExecutionSettings]:
        """Return the settings by which a joint is moved."""
        if joint.type != PRISMATIC:
            return self.opening, self.execution
        opening = replace(self.opening, door_tolerance=self.slide_tolerance)
        return opening, replace(self.execution, door_slip=self.slide_slip)

    @classmethod
    def check(cls, values: Mapping[str, Any]) -> SkillNodeSettings:
        """Check the values of the parameters, by name, together; each one is valid by itself.

        Raises
        ------
        ParameterError, ConfigurationError, FileNotFoundError
            If one is wrong.
        """
        model = KinematicModel.load(values["model"])
        if not model.actions:
            raise ParameterError(
                f"'model' must be that of an object whose file has 'actions', '{model.name}' has "
                "none"
            )
        execution, opening = pick(ExecutionSettings, values), pick(OpeningSettings, values)
        if values["control"] != TOPIC:
            execution = replace(execution, part_duration=math.inf)
        return cls(
            model=model,
            robot=values["robot"],
            world_frame=values["world_frame"],
            base_frame=values["base_frame"],
            transform_delay=values["transform_delay"],
            planning_time=values["planning_time"],
            preempt=values["preempt"],
            control=values["control"],
            controller_timeout=values["controller_timeout"],
            base_rate=values["base_rate"],
            door_angles=values["door_angles"],
            door=pick(AcceptanceSettings, values),
            states=pick(StateSettings, values),
            grip=pick(GripSettings, values),
            tracking=pick(TrackingSettings, values),
            execution=execution,
            opening=opening,
            slide_slip=values["slide_slip"],
            slide_tolerance=values["slide_tolerance"],
        )
