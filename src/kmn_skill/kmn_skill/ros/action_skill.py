"""What skill_node has for each action of its object: who plans it, and what is known for it."""

from __future__ import annotations

from typing import NamedTuple

from kmn_skill.execution.door_memory import DoorMemory
from kmn_skill.execution.hand_force import HandForce
from kmn_skill.execution.held_door import HeldDoor
from kmn_skill.execution.knowledge import Knowledge
from kmn_skill.execution.other_objects import OtherObjects
from kmn_skill.execution.perceived_door import PerceivedDoor
from kmn_skill.execution.states import StateWatch
from kmn_skill.planning.planner import Planner
from kmn_skill.planning.planning_setup import PlanningSetup
from kmn_skill.ros.skill_node_parameters import SkillNodeSettings


class ActionSkill(NamedTuple):
    """One action of an object, with a planner's process of its own.

    Attributes
    ----------
    setup
        Of the object with this action alone.
    knowledge
        Of the world, as far as this action needs it; the robot's states and the objects beside this
        one are those of all.
    """

    setup: PlanningSetup
    planner: Planner
    knowledge: Knowledge

    @classmethod
    def make(
        cls,
        setup: PlanningSetup,
        planner: Planner,
        settings: SkillNodeSettings,
        memory: DoorMemory,
        watch: StateWatch,
        others: OtherObjects,
    ) -> ActionSkill:
        """Return the skill, which knows of no object yet."""
        model = setup.model
        width = setup.robot.planning.pads.width
        knowledge = Knowledge(
            model,
            PerceivedDoor(model, settings.world_frame, settings.door),
            memory,
            watch,
            HeldDoor(model, setup.action, planner.pads, width, settings.grip),
            HandForce(),
            setup.settings.surroundings,
            others,
        )
        return cls(setup, planner, knowledge)

    def forget(self, time: float) -> None:
        """Forget the object of before a time (s), as of another world."""
        self.knowledge.door.forget(time)
        self.knowledge.held.let_go()
        self.knowledge.memory.forget()

    def take(self, settings: SkillNodeSettings) -> None:
        """Take over changed settings."""
        self.knowledge.door.settings = settings.door
        self.knowledge.held.settings = settings.grip
