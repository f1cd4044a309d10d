"""Plans to open a cupboard that has another object at its hinge, or at its handle."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from kmn_perception.model.kinematic_model import KinematicModel
from kmn_skill.execution.door_observation import DoorObservation
from kmn_skill.execution.other_objects import OtherObjects
from kmn_skill.experiments.settings import Experiment
from kmn_skill.planning.check import PlanRejected, check
from kmn_skill.planning.plan import Plan, PlanRequest
from kmn_skill.planning.planning_setup import PlanningSetup
from kmn_skill.planning.prototypes import Prototypes
from kmn_skill.planning.solver import Solver

CUPBOARD, FRIDGE = KinematicModel.load("cupboard_door"), KinematicModel.load("fridge")
SETUP = PlanningSetup.load(CUPBOARD)
SOLVER, MOTIONS = Solver(SETUP), Prototypes.load(SETUP.action.motions)
VALUES = np.array([0.0, 0.0, 0.2, *np.zeros(4)])
REQUEST = Experiment.load().request(SETUP, VALUES, "pull")
BOTH = (0.5 + 0.6) / 2.0  # metres between the middles of the two that touch each other


@pytest.fixture(scope="module")
def alone() -> Plan:
    return plan(REQUEST)


def plan(request: PlanRequest) -> Plan:
    """Return the first plan that passes the check."""
    planner = SETUP.settings.planner
    for guess in MOTIONS.guesses(request, planner.attempts, planner.spread):
        try:
            return SOLVER.plan(replace(request, hold=guess.hold), guess.solution, guess.name)
        except PlanRejected:
            continue
    raise AssertionError("there is no plan")


def beside(side: float, yaw: float) -> PlanRequest:
    """Return the request where a fridge is seen at a side, turned by ``yaw`` (rad)."""
    pose = CUPBOARD.transformation.matrix(VALUES[:3])
    pose[:3, 3] += side * BOTH * pose[:3, 1]
    theta = FRIDGE.transformation.read_back(pose) + [0.0, 0.0, yaw]
    values = np.concatenate([theta, np.zeros(5)])
    names = tuple(parameter.name for parameter in FRIDGE.parameters)
    others = OtherObjects(CUPBOARD, "world", limit_margin=10.0)
    others.add(DoorObservation(0.0, "fridge", "world", names, values, np.eye(8), "", number=2))
    return replace(REQUEST, obstacles=others.around(CUPBOARD, VALUES))


@pytest.mark.parametrize(
    ("side", "yaw", "touched"),
    [(-1.0, 0.0, "panel"), (-1.0, 0.02, "panel"), (1.0, 0.0, "bar"), (1.0, 0.05, "bar")],
)
def test_a_plan_keeps_clear_of_what_is_beside(
    alone: Plan, side: float, yaw: float, touched: str
) -> None:
    request = beside(side, yaw)
    assert len(request.obstacles) == 3
    world = SOLVER.world(request)
    with pytest.raises(PlanRejected, match=f"fridge_2/{touched}"):
        check(alone, request, world)
    found = plan(request)
    assert check(found, request, world).clearance >= SETUP.settings.check.clearance


def test_what_is_far_away_does_not_change_the_plan(alone: Plan) -> None:
    far = beside(-4.0, 0.0)
    assert len(far.obstacles) == 3
    assert np.array_equal(plan(far).positions, alone.positions)
