"""Which door a goal is planned for: where one was before the robot hid it, or another one."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from kmn_perception.configuration.node_parameters import load_node_parameters
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_skill.execution.door_memory import DoorMemory
from kmn_skill.execution.door_observation import DoorObservation, when_closed
from kmn_skill.execution.goal import SUCCESS, Feedback, Goal, Result
from kmn_skill.execution.grasp_quantities import hinge_distance, swung
from kmn_skill.execution.hand_force import HandForce
from kmn_skill.execution.held_door import HeldDoor
from kmn_skill.execution.knowledge import Knowledge
from kmn_skill.execution.opening import DoorOpening
from kmn_skill.execution.other_objects import OtherObjects
from kmn_skill.execution.perceived_door import PerceivedDoor
from kmn_skill.execution.states import Sample, StateWatch
from kmn_skill.planning.plan import PlanningFailed, PlanRequest
from kmn_skill.planning.planning_setup import PlanningSetup
from kmn_skill.ros.skill_node_parameters import SkillNodeSettings

STATED = load_node_parameters("skill_node")
SETTINGS = SkillNodeSettings.check({name: each.default for name, each in STATED.items()})
MODEL = KinematicModel.load("door")
SETUP = PlanningSetup.load(MODEL)
NOW = 100.0  # seconds
DOOR: NDArray[np.float64] = np.array([0.1, -0.2, 0.3, 0.0, 0.0, 0.0, 0.0])


class Planner:
    """Keeps what is to be planned, and knows no plan."""

    request: PlanRequest | None = None

    drives = True

    def plan(self, request: PlanRequest, cancelled: Callable[[], bool]) -> Any:
        self.request = request
        raise PlanningFailed("none is known")

    def reach(self, values: NDArray[np.float64], positions: NDArray[np.float64]) -> float:
        return -1.0


class Robot:
    """Stands still, and tells nobody."""

    hold_duration = 0.1

    def now(self) -> float:
        return NOW

    def hold(self, positions: NDArray[np.float64]) -> None:
        pass

    def tell(self, text: str) -> None:
        pass

    def interruption(self) -> None:
        return None

    def feed_back(self, feedback: Feedback) -> None:
        pass


def pursue(
    seen: NDArray[np.float64],
    remembered: bool = False,
    hinge: float = np.nan,
    beside: Sequence[DoorObservation] = (),
) -> tuple[Result, PlanRequest | None]:
    """Return what becomes of a goal, and what is planned for it.

    A door is seen, open by an angle, after the robot has driven a metre.
    """
    home = SETUP.robot.home
    memory = DoorMemory()
    if remembered:
        memory.keep(DOOR, home, NOW)
    watch = StateWatch(SETTINGS.states, {"joint_states": SETUP.robot.joint_names})
    driven = home.copy()
    driven[0] += 1.0
    watch.put("joint_states", Sample(NOW, driven))
    door = PerceivedDoor(MODEL, "world", SETTINGS.door)
    names = tuple(parameter.name for parameter in MODEL.parameters)
    for age in (0.2, 0.1, 0.0):
        covariance = 1e-8 * np.eye(len(seen))
        told = DoorObservation(NOW - age, "door", "world", names, seen, covariance, "")
        door.add(told._replace(joints={"hinge": hinge}))
    held = HeldDoor(
        MODEL,
        SETUP.action,
        lambda robot: np.zeros((2, 3)),
        SETUP.robot.planning.pads.width,
        SETTINGS.grip,
    )
    others = OtherObjects(MODEL, "world", SETTINGS.door.limit_margin)
    for each in beside:
        others.add(each)
    wall = SETUP.settings.surroundings
    knowledge = Knowledge(MODEL, door, memory, watch, held, HandForce(), wall, others)
    planner, robot = Planner(), Robot()
    opening: Any = DoorOpening
    result = opening(knowledge, planner, robot, robot, SETTINGS.opening, SETTINGS.execution).run(
        Goal(-0.7, -0.9)
    )
    return result, planner.request


def planned_for(seen: NDArray[np.float64], remembered: bool) -> NDArray[np.float64]:
    """Return the door that is planned for."""
    result, request = pursue(seen, remembered)
    assert result.outcome == "no_plan"
    assert request is not None
    return np.concatenate([request.theta, request.gamma])


@pytest.mark.parametrize(("hinge", "is_there"), [(-0.84, True), (-0.78, False), (0.9, False)])
def test_a_door_that_is_open_so_far_already_is_left_alone(hinge: float, is_there: bool) -> None:
    result, request = pursue(DOOR, hinge=hinge)
    assert (result.outcome == SUCCESS, request is None) == (is_there, is_there)
    assert result.opened == pytest.approx(hinge)


def test_a_door_that_the_robot_may_hide_is_where_it_was_before() -> None:
    hidden = DOOR + [0.04, -0.03, 0.05, 0.0, 0.0, 0.0, 0.0]
    assert planned_for(hidden, remembered=True) == pytest.approx(DOOR)
    assert planned_for(hidden, remembered=False) == pytest.approx(hidden)


@pytest.mark.parametrize("away", [[0.0, 0.7, 0.0], [-0.6, 0.2, 0.5]])
def test_another_door_is_not_taken_for_the_one_before(away: list[float]) -> None:
    other = DOOR + [*away, 0.0, 0.0, 0.0, 0.0]
    assert planned_for(other, remembered=True) == pytest.approx(other)


@pytest.mark.parametrize("angle", [-0.9, -0.2, 0.0, 0.4])
def test_a_door_that_is_seen_ajar_tells_by_how_much_against_where_it_was_closed(
    angle: float,
) -> None:
    """Its hinge stays where it is, whatever its yaw."""
    ajar = when_closed(MODEL, DOOR, -angle)
    assert swung(MODEL, DOOR, ajar) == pytest.approx(angle)
    assert hinge_distance(MODEL, DOOR, ajar) == pytest.approx(0.0, abs=1e-9)
    assert hinge_distance(MODEL, DOOR + [0.3, 0.4, 0.0, 0.0, 0.0, 0.0, 0.0], ajar) == (
        pytest.approx(0.5)
    )


@pytest.mark.parametrize(("age", "remembered"), [(0.1, False), (5.0, False), (5.0, True)])
def test_what_was_seen_beside_a_door_is_kept_clear_of_as_long_as_the_door_is_known(
    age: float, remembered: bool
) -> None:
    """A robot that hides the door hides that, too."""
    drawer = KinematicModel.load("drawer")
    names = tuple(parameter.name for parameter in drawer.parameters)
    values = np.array([0.1, 0.5, 0.3, *np.zeros(5)])
    told = DoorObservation(NOW - age, "drawer", "world", names, values, np.eye(8), "", number=2)
    _, request = pursue(DOOR, remembered, beside=[told])
    assert request is not None
    found = {each.name for each in request.obstacles}
    expected = {f"drawer_2/{body.name}" for body in drawer.bodies}
    assert found == (set() if age > SETTINGS.door.max_age and not remembered else expected)
