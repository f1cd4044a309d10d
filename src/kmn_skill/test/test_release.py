"""A hand that is at the handle lets go, and the plan from there passes the check."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from kmn_perception.model.kinematic_model import KinematicModel
from kmn_skill.planning.check import check
from kmn_skill.planning.plan import Plan, PlanRequest
from kmn_skill.planning.planner import Planner
from kmn_skill.planning.planning_setup import PlanningSetup
from kmn_skill.planning.prototypes import Prototypes
from kmn_skill.planning.world import World

SETUP = PlanningSetup.load(KinematicModel.load("door"))
POLICY = SETUP.settings.policy
FIRST = PlanRequest(np.zeros(3), np.zeros(4), SETUP.robot.home, np.zeros(2), -0.7, -0.9)


@pytest.fixture(scope="module")
def planner() -> Iterator[Planner]:
    with Planner(SETUP, Prototypes.load("door")) as planner:
        yield planner


@pytest.fixture(scope="module")
def plan(planner: Planner) -> Plan:
    return planner.plan(FIRST)


def stopped(plan: Plan, phase: str) -> PlanRequest:
    """Return the request of a robot that was stopped in the middle of a phase."""
    _, first, last = next(each for each in plan.phases if each.name == phase)
    here = (first + last + 1) // 2
    return PlanRequest(
        FIRST.theta, FIRST.gamma, plan.positions[here], plan.object_joints[here], -0.7, -0.9
    )


@pytest.mark.parametrize("phase", ["grasp", "press", "open"])
def test_a_hand_at_the_handle_opens_and_draws_straight_back(
    planner: Planner, plan: Plan, phase: str
) -> None:
    request = stopped(plan, phase)
    found = planner.plan(request)
    world = World(SETUP, request.theta, request.gamma)
    assert check(found, request, world).clearance == found.report.clearance
    assert [each.name for each in found.phases] == ["release", "reach", "grasp", "press", "open"]
    for before, after in zip(found.phases, found.phases[1:], strict=False):
        assert before.last == after.first
    _, first, last = found.phases[0]
    released = found.positions[first : last + 1]
    np.testing.assert_allclose(
        released[:, 2:10], request.start[None, 2:10].repeat(len(released), 0), atol=1e-9
    )
    way = np.linalg.norm(released[:, :2] - request.start[:2], axis=1)
    assert way[-1] == pytest.approx(-POLICY.pre_grasp)
    assert (released[way > 1e-6, 10] >= SETUP.robot.planning.grip.open - 1e-9).all()
    assert not found.velocities[[first, last]].any()
    assert found.object_joints[last] == pytest.approx([request.object_start[0], 0.0])


@pytest.mark.parametrize("short", [0, 2, 5])
def test_an_open_hand_at_the_handle_draws_back_too(
    planner: Planner, plan: Plan, short: int
) -> None:
    here = plan.phase("reach").last - short
    request = replace(FIRST, start=plan.positions[here])
    restarts = planner.restarts
    found = planner.plan(request)
    assert planner.restarts == restarts
    check(found, request, World(SETUP, request.theta, request.gamma))
    assert [each.name for each in found.phases] == ["release", "reach", "grasp", "press", "open"]
    away = found.positions[found.phases[0].last, :2] - request.start[:2]
    assert np.linalg.norm(away) == pytest.approx(-POLICY.pre_grasp)


def test_a_handle_that_stands_a_little_beyond_its_limit_is_no_hindrance(
    planner: Planner, plan: Plan
) -> None:
    request = stopped(plan, "grasp")
    request = replace(request, object_start=np.array([0.0, 3e-4]))
    assert planner.plan(request).phases[0].name == "release"


def test_a_hand_that_is_on_its_way_has_nothing_to_let_go(planner: Planner, plan: Plan) -> None:
    _, first, last = plan.phases[0]
    quarter = (first + last) // 4
    request = PlanRequest(
        FIRST.theta, FIRST.gamma, plan.positions[quarter], plan.object_joints[quarter], -0.7, -0.9
    )
    assert planner.plan(request).phases[0].name == "reach"
