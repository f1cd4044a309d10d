"""The policy's problem is that of the door, wherever it stands; the transfer goes with it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import robotic as ry

from kmn_perception.model.kinematic_model import KinematicModel
from kmn_skill.planning.plan import PlanRequest
from kmn_skill.planning.planning_setup import PlanningSetup
from kmn_skill.planning.policy import Policy, near_pairs, pairs
from kmn_skill.planning.prototypes import Prototypes, Solution
from kmn_skill.planning.transfer import hermite, move_base, refine, transfer
from kmn_skill.planning.world import World

MODEL = KinematicModel.load("door")
SETUP, ACTION = PlanningSetup.load(MODEL), MODEL.actions[0]
SOLUTIONS = {name: known[0].path for name, known in Prototypes.load("door").solutions.items()}
HOME = SETUP.robot.home
THETA = np.array([0.4, -0.6, 0.8])
ZERO = np.zeros(3), np.zeros(4)
START = np.array([*HOME, 0.0, 0.0])
DOOR_ANGLES = {"pull": -0.9, "push": 0.9}


def request(mode: str, **changes: Any) -> PlanRequest:
    values: dict[str, Any] = {
        "theta": ZERO[0],
        "gamma": ZERO[1],
        "start": HOME,
        "object_start": np.zeros(2),
        "unlatched": -0.7,
        "target": DOOR_ANGLES[mode],
    }
    return PlanRequest(**{**values, **changes})


def squared(asked: PlanRequest, path: Any) -> dict[Any, float]:
    """Return the squared features of a path by their kind; inequalities where violated."""
    world = World(SETUP, asked.theta, asked.gamma)
    slices = len(path) // 4
    policy = Policy(world, asked, slices, pairs(world))
    problem = policy.problem.nlp()
    features = problem.evaluate(np.reshape(path, -1))[0]
    kinds = np.array([int(kind) for kind in problem.getTypes()])
    features = np.where(kinds == int(ry.OT.ineq), np.maximum(features, 0.0), features)
    return {kind: float(np.square(features[kinds == kind]).sum()) for kind in set(kinds.tolist())}


@pytest.mark.parametrize("mode", DOOR_ANGLES)
def test_the_prototype_s_solution_fulfils_the_constraints(mode: str) -> None:
    found = squared(request(mode), SOLUTIONS[mode][1:])
    assert found[int(ry.OT.eq)] < 1e-2
    assert found[int(ry.OT.ineq)] < 1e-2


@pytest.mark.parametrize("mode", DOOR_ANGLES)
def test_moved_with_door_and_start_the_solution_has_the_same_features(mode: str) -> None:
    solution = SOLUTIONS[mode]
    start = np.array([*move_base(HOME[:3], THETA[2], np.zeros(2), THETA[:2]), *HOME[3:]])
    moved = request(mode, theta=THETA, start=start)
    before = squared(request(mode), solution[1:])
    after = squared(moved, transfer(Solution(ZERO[1], solution), MODEL, ACTION, moved))
    for kind, value in before.items():
        assert after[kind] == pytest.approx(value, rel=1e-3, abs=1e-3)


def test_the_base_moves_as_a_pose_does() -> None:
    base = np.array([1.0, 2.0, 0.3])
    expected = MODEL.transformation.matrix(THETA) @ MODEL.transformation.matrix(base)
    moved = move_base(base, THETA[2], np.zeros(2), THETA[:2])
    assert MODEL.transformation.matrix(moved) == pytest.approx(expected)


def test_the_transfer_begins_at_the_start_and_ends_at_the_goal() -> None:
    solution = SOLUTIONS["pull"]
    asked = request("pull", theta=THETA, object_start=np.array([-0.2, -0.1]), target=-0.6)
    guess = transfer(Solution(ZERO[1], solution), MODEL, ACTION, asked)
    assert len(guess) == len(solution) - 1
    assert np.abs(guess[0, :11] - asked.start).max() < 0.6  # one step away
    assert guess[0, 11:] == pytest.approx([-0.2, -0.1], abs=1e-6)
    assert guess[-1, 11:] == pytest.approx([-0.6, -0.52], abs=1e-4)  # let up to 0.7 of its way


def test_a_handle_at_another_place_moves_the_base_with_it() -> None:
    solution = SOLUTIONS["pull"]
    gamma = np.array([0.0, 0.1, 0.02, 0.05])
    guess = transfer(Solution(ZERO[1], solution), MODEL, ACTION, request("pull", gamma=gamma))
    handle = MODEL.joints[1]
    shift = handle.origin(gamma) - handle.origin(ZERO[1])
    grasp = 2 * (len(guess) // 4)  # the door is closed
    assert guess[grasp, :2] - solution[grasp + 1, :2] == pytest.approx(shift[:2], abs=1e-4)


def test_a_wrong_target_violates_the_equalities() -> None:
    found = squared(request("pull", target=-0.5), SOLUTIONS["pull"][1:])
    assert found[int(ry.OT.eq)] > 1.0


def test_a_path_through_the_door_violates_the_inequalities() -> None:
    path = SOLUTIONS["push"][1:].copy()
    path[:8, 0] += 0.6
    assert squared(request("push"), path)[int(ry.OT.ineq)] > 0.1


def test_only_near_pairs_are_kept_as_long_as_they_are_near() -> None:
    world = World(SETUP, *ZERO)
    everything = pairs(world)
    path = SOLUTIONS["pull"][1:]
    near = near_pairs(world, everything, path, 0.1)
    assert 0 < len(near) < len(everything)
    assert all(0.0 <= pair.begin < pair.end <= 4.0 for pair in near)
    assert near_pairs(world, everything, path, -1.0) == []
    assert ("base", "door_handle") not in [pair[:2] for pair in near]


def test_a_refined_path_passes_through_the_coarse_one() -> None:
    path = SOLUTIONS["pull"][1:]
    fine = refine(path, START, 50)
    assert fine.shape == (200, 13)
    assert fine[[49, 99, 199]] == pytest.approx(path[[4, 9, 19]])
    moved = np.abs(fine[100] - fine[99])
    assert moved[:10].max() < 1e-3  # only the gripper closes
    assert moved[10] > 0.1


def test_the_spline_is_cubic() -> None:
    times = np.array([0.0, 0.5, 2.0])
    coefficients = np.array([0.3, -1.0, 2.0, 0.5])
    nodes, velocities = np.polyval(coefficients, times), np.polyval(np.polyder(coefficients), times)
    at = np.linspace(0.0, 2.0, 21, dtype=np.float64)
    found = hermite(nodes[:, None], velocities[:, None], times, at)[:, 0]
    assert found == pytest.approx(np.polyval(coefficients, at))


@pytest.mark.parametrize("mode", DOOR_ANGLES)
def test_the_derivatives_are_those_of_the_features(mode: str) -> None:
    asked, path = request(mode), SOLUTIONS[mode][1:]
    policy = Policy(World(SETUP, asked.theta, asked.gamma), asked, len(path) // 4, [])
    problem = policy.problem.nlp()
    at, step = path.reshape(-1) + 0.01, 1e-6
    rows, columns, values = np.transpose(problem.evaluate(at)[1])
    jacobian = np.zeros((len(problem.evaluate(at)[0]), len(at)))
    np.add.at(jacobian, (rows.astype(int), columns.astype(int)), values)
    for column in (*range(60, 130, 9), *range(12, len(at), 13), *range(11, len(at), 13)):
        aside = step * np.eye(len(at))[column]
        after, before = (problem.evaluate(at + way)[0] for way in (aside, -aside))
        assert jacobian[:, column] == pytest.approx((after - before) / (2.0 * step), abs=1e-3)
