"""What a plan is made with, beside the request: one object, one robot, and the policy."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from kmn_perception.configuration.section import ConfigurationError
from kmn_perception.model.actions import Action
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_skill.planning.robot import RobotModel
from kmn_skill.planning.settings import SkillSettings

NO_LATCH = "no_latch"  # joint that stands still, of objects that nothing unlatches


@dataclass(frozen=True, eq=False)
class PlanningSetup:
    """Object, robot and policy, as a program has loaded them; can be sent to another process.

    Raises
    ------
    ConfigurationError
        If the object's file has no action.
    """

    model: KinematicModel
    robot: RobotModel
    settings: SkillSettings

    def __post_init__(self) -> None:
        if not self.model.actions:
            raise ConfigurationError(
                f"model '{self.model.name}' has no 'actions': nothing is said of what is grasped "
                "and moved"
            )

    @property
    def action(self) -> Action:
        """What is done: the first action of the object's file."""
        return self.model.actions[0]

    @classmethod
    def load(cls, model: KinematicModel, robot: str | Path = "") -> PlanningSetup:
        """Return the shipped policy for a kinematic model and a robot, see `RobotModel.load`."""
        return cls(model, RobotModel.load(robot), SkillSettings.load())

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names (D,) of the robot's joints, then of the object's two."""
        latch = self.action.unlatch
        unlatching = NO_LATCH if latch is None else latch.name
        return (*self.robot.joint_names, self.action.joint.name, unlatching)
