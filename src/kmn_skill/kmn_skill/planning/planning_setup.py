"""What a plan is made with, beside the request: one object, one robot, and the policy."""

from __future__ import annotations

from dataclasses import dataclass

from kmn_perception.configuration.section import ConfigurationError
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_skill.planning.layout import HANDLE
from kmn_skill.planning.robot import RobotModel
from kmn_skill.planning.settings import SkillSettings


@dataclass(frozen=True, eq=False)
class PlanningSetup:
    """Object, robot and policy, as a program has loaded them; can be sent to another process.

    Raises
    ------
    ConfigurationError
        If the object is no door whose hinge and handle the policy can move.
    """

    model: KinematicModel
    robot: RobotModel
    settings: SkillSettings

    def __post_init__(self) -> None:
        moved = [joint.body for joint in self.model.joints]
        grasped = self.settings.grasp.body
        if moved[HANDLE:] != [grasped]:
            raise ConfigurationError(
                f"model '{self.model.name}' must have two joints, hinge and handle, of which the "
                f"second moves '{grasped}'; its joints move: {', '.join(moved) or 'nothing'}"
            )

    @classmethod
    def load(cls, model: KinematicModel) -> PlanningSetup:
        """Return the shipped policy and its robot for a kinematic model."""
        settings = SkillSettings.load()
        return cls(model, RobotModel.load(settings.robot), settings)

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names (D,) of the robot's joints, then of the model's."""
        return (*self.robot.joint_names, *(joint.name for joint in self.model.joints))
