"""What is known of the world, and kept from goal to goal."""

from __future__ import annotations

from typing import NamedTuple

from kmn_perception.model.kinematic_model import KinematicModel
from kmn_skill.execution.door_memory import DoorMemory
from kmn_skill.execution.hand_force import HandForce
from kmn_skill.execution.held_door import HeldDoor
from kmn_skill.execution.other_objects import OtherObjects
from kmn_skill.execution.perceived_door import PerceivedDoor
from kmn_skill.execution.states import StateWatch
from kmn_skill.planning.surroundings import SurroundingsSettings


class Knowledge(NamedTuple):
    """Who knows the world.

    Attributes
    ----------
    model
        Kinematic model of the door.
    door, memory
        The door as it is seen, and as it was seen before the robot hid it.
    watch
        Of the states of the robot, and of the door where an encoder tells them.
    held
        The door's angles where no encoder tells them.
    force
        Of the hand on what it holds.
    wall
        Around the door, where there is one.
    others
        Objects beside the door.
    """

    model: KinematicModel
    door: PerceivedDoor
    memory: DoorMemory
    watch: StateWatch
    held: HeldDoor
    force: HandForce
    wall: SurroundingsSettings
    others: OtherObjects
