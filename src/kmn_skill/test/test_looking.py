"""From where a robot looks at a door that it does not know well enough, and when it gives up."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray

from kmn_perception.configuration.node_parameters import load_node_parameters
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_skill.execution.door_memory import DoorMemory
from kmn_skill.execution.door_observation import DoorObservation
from kmn_skill.execution.errors import DoorError
from kmn_skill.execution.looking import Looking
from kmn_skill.execution.perceived_door import PerceivedDoor
from kmn_skill.planning.plan import PlanningFailed
from kmn_skill.ros.skill_node_parameters import SkillNodeSettings

STATED = load_node_parameters("skill_node")
SETTINGS = SkillNodeSettings.check({name: each.default for name, each in STATED.items()})
MODEL = KinematicModel.load("door")
NAMES = tuple(parameter.name for parameter in MODEL.parameters)
DOOR: NDArray[np.float64] = np.array([0.1, -0.2, 0.3, 0.0, 0.0, 0.0, 0.0])
DEVIATION_AT_A_METRE = 0.02  # metres; of stereo it grows with the square of the distance


class State(NamedTuple):
    """Where the robot is, its joints (J,)."""

    robot: NDArray[np.float64]


class World:
    """A base that is at once where it is sent, and a door that it sees worse from further away.

    Parameters
    ----------
    nearest
        Metres from the door to which the base can come.
    behind
        Metres by which its camera stands behind the middle of the base.
    """

    drives = True

    def __init__(self, nearest: float, behind: float = 0.0) -> None:
        self.nearest, self.behind, self.time = nearest, behind, 0.0
        self.robot = np.array([DOOR[0] - 3.3, DOOR[1], 0.0])
        self.door = PerceivedDoor(MODEL, "world", SETTINGS.door)
        self.places: list[float] = []
        self.told: list[str] = []

    @property
    def distance(self) -> float:
        return float(np.linalg.norm(self.robot[:2] - DOOR[:2]))

    def state(self) -> State:
        return State(self.robot)

    def now(self) -> float:
        return self.time

    def tell(self, text: str) -> None:
        self.told.append(text)

    def reach(self, values: NDArray[np.float64], positions: NDArray[np.float64]) -> float:
        return -self.distance

    def look(self, values: Any, start: Any, place: NDArray[np.float64], clearance: float) -> Any:
        if np.linalg.norm(place[:2] - DOOR[:2]) < self.nearest:
            raise PlanningFailed("too near")
        return place

    def follow(self, place: NDArray[np.float64]) -> None:
        self.robot = place
        self.places.append(self.distance)

    def see(self) -> None:
        """Look at the door in as many frames as are needed."""
        deviation = DEVIATION_AT_A_METRE * (self.distance + self.behind) ** 2
        covariance = deviation**2 * np.diag([1.0, 1.0, 1e-6, 0.0, 0.0, 0.0, 0.0])
        for _ in range(SETTINGS.door.min_consistent_frames):
            self.time += 0.1
            seen = DoorObservation(self.time, "door", "world", NAMES, DOOR, covariance, "")
            self.door.add(seen)

    def looking(self, looks: int, patience: float) -> Looking:
        """Return the looks of a goal."""
        made: Any = Looking
        settings = replace(
            SETTINGS.opening,
            look_distance=1.4,
            look_nearer=0.75,
            looks=looks,
            look_patience=patience,
        )
        knowledge = type("Knowledge", (), {"model": MODEL, "door": self.door})
        knowledge.memory = DoorMemory()  # type: ignore[attr-defined]
        looking: Looking = made(knowledge, self, self, self, settings)
        return looking

    def look_around(self, looks: int) -> tuple[bool, Looking]:
        """Look until there is nothing to be seen better; tell whether the door is relied on."""
        looking = self.looking(looks, 0.0)
        state: Any = self.state()
        self.see()
        while looking.move_to_see(state):
            self.see()
        try:
            self.door.values(self.time)
        except DoorError:
            return False, looking
        return True, looking


@pytest.mark.parametrize(
    ("behind", "places"), [(-0.5, [1.4]), (-0.1, [1.4, 1.05]), (0.2, [1.4, 1.05, 0.7875])]
)
def test_it_looks_from_nearer_until_the_handle_is_known(behind: float, places: list[float]) -> None:
    world = World(0.0, behind)
    assert world.look_around(3)[0]
    assert world.places == pytest.approx(places)
    assert len(world.told) == len(places)
    assert all("the standard deviation of the handle is" in text for text in world.told)


@pytest.mark.parametrize(
    ("nearest", "looks", "said"),
    [
        (0.0, 2, "looked from 1.40, 1.05 m before it"),
        (1.2, 3, "looked from 1.40 m before it; too near"),
    ],
)
def test_a_handle_that_no_place_shows_well_enough_is_refused_with_what_was_tried(
    nearest: float, looks: int, said: str
) -> None:
    world = World(nearest, behind=0.5)
    is_known, looking = world.look_around(looks)
    assert not is_known
    with pytest.raises(DoorError) as refused:
        world.door.values(world.time)
    error = looking.reason(refused.value)
    assert error.reason == "uncertain"
    assert str(error).startswith("the standard deviation of the handle is")
    assert str(error).endswith(said)
    assert len(world.places) <= looks


def test_from_where_it_was_already_seen_it_does_not_look_again() -> None:
    """After a failed grasp the robot draws back to the first place by itself."""
    world = World(0.0, behind=0.2)
    _, looking = world.look_around(3)
    looking.again(DOOR)
    state: Any = world.state()
    world.see()
    assert looking.move_to_see(state)
    assert world.places[-2:] == pytest.approx([1.4, 1.05])


def test_it_looks_for_a_while_before_it_looks_from_nearer() -> None:
    """The first frames from a new place may differ, or know little, as those that follow do not."""
    world = World(0.0, behind=0.2)
    looking = world.looking(3, patience=3.0)
    state: Any = world.state()
    world.see()
    assert looking.move_to_see(state)  # seen from afar: at once
    world.see()
    assert not looking.move_to_see(state)
    world.time += 3.0
    world.see()
    assert looking.move_to_see(state)
    assert world.places == pytest.approx([1.4, 1.05])
