"""The ROS parameters of skill_node, which ``config/nodes/skill_node_parameters.yaml`` states."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from kmn_perception.configuration.node_parameters import ParameterError
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.ros.parameters import pick
from kmn_skill.execution.opening import OpeningSettings
from kmn_skill.execution.perceived_door import AcceptanceSettings
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
        """Check the values of the parameters, by name, together; each one is valid by itself.

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
        return cls(
            model=model,
            world_frame=values["world_frame"],
            planning_time=values["planning_time"],
            door=pick(AcceptanceSettings, values),
            states=pick(StateSettings, values),
            execution=pick(ExecutionSettings, values),
            opening=pick(OpeningSettings, values),
        )
