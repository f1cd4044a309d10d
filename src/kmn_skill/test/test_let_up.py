"""The latch is let up once it is clear: a hand that slides along a lever has room to both sides."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from numpy.typing import NDArray

from kmn_perception.model.kinematic_model import KinematicModel
from kmn_skill.execution.held_door import GripSettings, HeldDoor
from kmn_skill.planning.plan import Plan, PlanRequest
from kmn_skill.planning.planner import Planner
from kmn_skill.planning.planning_setup import PlanningSetup
from kmn_skill.planning.prototypes import Prototypes

MODEL = KinematicModel.load("door")
SETUP = PlanningSetup.load(MODEL)
SLIDE = 0.035  # metres by which a door is believed too wide
PRESSED, LET_UP = -0.7, -0.49


@pytest.fixture(scope="module")
def planner() -> Iterator[Planner]:
    with Planner(SETUP, Prototypes.load("door")) as planner:
        yield planner


def plan_for(planner: Planner, target: float, too_wide: float = 0.0) -> Plan:
    """Plan for a door whose hinge is believed that much (m) further from the handle."""
    theta, gamma = np.zeros(3), np.zeros(4)
    theta[1], gamma[1] = too_wide / 2.0, too_wide
    return planner.plan(PlanRequest(theta, gamma, SETUP.robot.home, np.zeros(2), PRESSED, target))


def held_angles(planner: Planner, plan: Plan) -> NDArray[np.float64]:
    """Return the angles (N, 2) of the prototype's joints from where the hand grasped on."""
    first = plan.phase("grasp").last
    held = HeldDoor(MODEL, SETUP.action, planner.pads, 0.0255, GripSettings(1.0, 0.02))
    held.see(MODEL.prototype, 0.0)
    held.grasp(plan.positions[first], np.zeros(2))
    return np.array([held.angles(positions) for positions in plan.positions[first:]])


@pytest.mark.parametrize("target", [-0.9, 0.9])
def test_a_handle_stays_pressed_until_the_door_is_clear_and_is_let_up_then(
    planner: Planner, target: float
) -> None:
    plan = plan_for(planner, target)
    hinge, handle = plan.object_joints[plan.phase("open").first :].T
    assert np.abs(hinge[handle < PRESSED + 0.01]).max() > 0.02
    assert np.diff(handle).min() > -0.01
    assert handle[-1] == pytest.approx(LET_UP, abs=0.01)


@pytest.mark.parametrize("target", [-0.9, 0.9])
def test_a_hand_on_a_door_believed_too_wide_does_not_press_the_lever_further(
    planner: Planner, target: float
) -> None:
    """Its hinge is nearer, so that the hand slides towards the spindle of the handle."""
    angles = held_angles(planner, plan_for(planner, target, too_wide=SLIDE))
    assert angles[:, 1].min() > PRESSED - 0.03  # one that stays pressed comes to -0.86
    assert abs(angles[-1, 0]) > 0.85
