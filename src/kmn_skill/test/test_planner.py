"""Plans pass a check that rejects broken ones, and the planner survives its process."""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from kmn_perception.model.kinematic_model import KinematicModel
from kmn_skill.planning.check import PlanRejected, check
from kmn_skill.planning.plan import Plan, PlanningCancelled, PlanningFailed, PlanReport, PlanRequest
from kmn_skill.planning.planner import Planner
from kmn_skill.planning.planning_setup import PlanningSetup
from kmn_skill.planning.prototypes import Prototypes
from kmn_skill.planning.timing import peaks
from kmn_skill.planning.world import World

Break = Callable[[Plan], Plan]
SETUP, PROTOTYPES = PlanningSetup.load(KinematicModel.load("door")), Prototypes.load("door")
SETTINGS, HOME = SETUP.settings, SETUP.robot.home


def request(target: float = -0.9, **changes: Any) -> PlanRequest:
    asked = PlanRequest(np.zeros(3), np.zeros(4), HOME, np.zeros(2), -0.7, target)
    return replace(asked, **changes)


def checked(plan: Plan, asked: PlanRequest, setup: PlanningSetup = SETUP) -> PlanReport:
    return check(plan, asked, World(setup, asked.theta, asked.gamma))


@pytest.fixture(scope="module")
def planner() -> Iterator[Planner]:
    with Planner(SETUP, PROTOTYPES) as planner:
        yield planner


@pytest.fixture(scope="module")
def plan(planner: Planner) -> Plan:
    return planner.plan(request())


def test_a_plan_has_the_form_that_was_agreed(plan: Plan) -> None:
    count = len(plan.times)
    assert plan.positions.shape == plan.velocities.shape == (count, 11)
    assert plan.object_joints.shape == (count, 2)
    assert [phase.name for phase in plan.phases] == ["reach", "grasp", "press", "open"]
    assert (plan.phases[0].first, plan.phases[-1].last) == (0, count - 1)
    for before, after in zip(plan.phases, plan.phases[1:], strict=False):
        assert before.last == after.first


def test_the_gripper_closes_while_all_else_rests(plan: Plan) -> None:
    _, first, last = plan.phases[1]
    assert SETTINGS.timing.dwell <= plan.times[last] - plan.times[first] < 1.0
    assert np.abs(plan.positions[last, :10] - plan.positions[first, :10]).max() < 1e-3
    assert not plan.velocities[[first, last]].any()
    assert plan.positions[last, 10] < plan.positions[first, 10] - 0.2


@pytest.mark.parametrize("door_angle", [-0.9, 0.9])
def test_plans_for_random_doors_reach_their_targets(planner: Planner, door_angle: float) -> None:
    model = KinematicModel.load("door")
    theta, gamma = model.split(model.sample(np.random.default_rng(3), 1)[0])
    asked = request(door_angle, theta=theta, gamma=gamma)
    found = planner.plan(asked)
    assert found.report.contact_error <= SETTINGS.check.contact
    assert found.report.clearance >= SETTINGS.check.clearance
    assert found.report.duration == found.times[-1]
    assert found.object_joints[-1] == pytest.approx([door_angle, -0.49], abs=0.01)
    assert found.positions[0] == pytest.approx(asked.start)


def test_a_door_that_is_ajar_is_opened_from_there(planner: Planner) -> None:
    start = np.array([-1.4, -0.2, 0.1, *HOME[3:]])
    asked = request(start=start, object_start=np.array([-0.2, -0.05]))
    found = planner.plan(asked)
    assert found.object_joints[0] == pytest.approx([-0.2, -0.05])
    assert found.object_joints[-1, 0] == pytest.approx(-0.9, abs=0.01)


@pytest.mark.parametrize(
    ("joint", "turned_to"),
    [
        ("l_forearm_roll_joint", 4.6),
        ("l_forearm_roll_joint", HOME[7] + 4.0 * np.pi),
        ("l_wrist_roll_joint", HOME[9] - 2.0 * np.pi),
        ("l_wrist_roll_joint", 3.5),
        ("base_yaw", -5.5),
        ("base_yaw", 3.5),
    ],
)
def test_a_joint_that_was_turned_beyond_half_a_turn_goes_on_from_there(
    planner: Planner, joint: str, turned_to: float
) -> None:
    start = HOME.copy()
    column = SETUP.robot.joint_names.index(joint)
    start[column] = turned_to
    found = planner.plan(request(start=start))
    np.testing.assert_allclose(found.positions[0], start, atol=1e-9)
    assert np.abs(np.diff(found.positions, axis=0)[:, column]).max() < 0.2
    assert np.abs(found.positions[:, column] - turned_to).max() < np.pi
    assert found.report.duration < 40.0


def shifted(plan: Plan, joint: int, offset: float, rows: slice) -> Plan:
    positions = plan.positions.copy()
    positions[rows, joint] += offset
    # Slowly, so that velocities are not what is wrong.
    return replace(plan, positions=positions, velocities=0.0 * positions, times=100.0 * plan.times)


def with_door(plan: Plan, rows: slice, column: int, angle: float) -> Plan:
    door = plan.object_joints.copy()
    door[rows, column] = angle
    return replace(plan, object_joints=door)


def from_grasp(plan: Plan) -> slice:
    return slice(plan.phase("grasp").last, None)


def pressing(plan: Plan) -> slice:
    first = plan.phase("press").first
    return slice(first + 1, first + 5)


def approaching(plan: Plan) -> slice:
    last = plan.phase("reach").last
    return slice(last - 20, last - 5)


def with_jerk(plan: Plan) -> Plan:
    velocities = plan.velocities.copy()
    velocities[5] = 0.0
    return replace(plan, velocities=velocities)


BREAKS: dict[str, Break] = {
    "not finite": lambda plan: replace(plan, times=np.full_like(plan.times, np.nan)),
    "away from the present state": lambda plan: shifted(plan, 0, 0.1, slice(0, 1)),
    "do not increase": lambda plan: replace(plan, times=plan.times[::-1] - plan.times[-1]),
    "end at rest": lambda plan: replace(plan, velocities=plan.velocities + 0.01),
    "of the velocity": lambda plan: replace(
        plan, times=plan.times / 4.0, velocities=4.0 * plan.velocities
    ),
    "of the acceleration": with_jerk,
    "l_elbow_flex_joint leaves its limits": lambda plan: shifted(plan, 6, 3.0, slice(50, 60)),
    "handle is moved to": lambda plan: with_door(
        plan, slice(plan.phase("press").last, None), 1, -0.5
    ),
    "handle is moved to -0.700, wanted is -0.49": lambda plan: with_door(
        plan, slice(-1, None), 1, -0.7
    ),
    "let up with the hinge at": lambda plan: with_door(
        plan, slice(plan.phase("open").first + 1, plan.phase("open").first + 5), 1, -0.6
    ),
    "hinge is moved to": lambda plan: with_door(plan, slice(-1, None), 0, -0.5),
    "before it is unlatched": lambda plan: with_door(plan, pressing(plan), 0, -0.1),
    "does not close": lambda plan: shifted(plan, 10, 0.3, from_grasp(plan)),
    "mm apart": lambda plan: shifted(plan, 0, -0.02, from_grasp(plan)),
    "it takes .* s, expected at most 120": lambda plan: replace(
        plan, times=plan.times * 20.0, velocities=plan.velocities / 20.0
    ),
    "comes within": lambda plan: shifted(plan, 0, 0.25, approaching(plan)),
}


@pytest.mark.parametrize("reason", BREAKS)
def test_a_broken_plan_is_rejected_with_its_reason(plan: Plan, reason: str) -> None:
    with pytest.raises(PlanRejected, match=reason):
        checked(BREAKS[reason](plan), request())


@pytest.mark.parametrize(
    ("limit", "reason"),
    [
        ("approach_speed", "the hand moves at"),
        ("held_speed", "the hand that holds the handle moves at"),
        ("moved_speed", "the hinge moves at"),
        ("latch_speed", "the handle moves at"),
    ],
)
def test_hand_and_door_must_not_be_too_fast(plan: Plan, limit: str, reason: str) -> None:
    slower = SETTINGS.timing._replace(**{limit: 0.7 * getattr(SETTINGS.timing, limit)})
    setup = replace(SETUP, settings=replace(SETTINGS, timing=slower))
    with pytest.raises(PlanRejected, match=reason):
        checked(plan, request(), setup)


def test_a_plan_passes_its_check_again(plan: Plan) -> None:
    report = checked(plan, request())
    assert report.contact_error == pytest.approx(plan.report.contact_error, abs=1e-6)


def test_the_prototype_s_plan_does_not_pass_for_another_door(plan: Plan) -> None:
    with pytest.raises(PlanRejected, match="mm"):
        checked(plan, request(theta=np.array([0.05, 0.0, 0.1])))


def test_the_peaks_are_those_of_the_spline() -> None:
    nodes, velocities = np.array([[0.0], [1.0]]), np.array([[0.0], [0.0]])
    fastest, sharpest = peaks(nodes, velocities, np.array([2.0]))
    assert fastest == pytest.approx([0.75])  # of 3 s^2 - 2 s^3, s = t / 2
    assert sharpest == pytest.approx([1.5])


def test_after_its_process_was_killed_the_planner_plans(planner: Planner) -> None:
    assert planner.pid is not None
    os.kill(planner.pid, signal.SIGKILL)
    assert planner.plan(request()).report.contact_error <= SETTINGS.check.contact


def test_stopped_processes_leave_no_folder_behind(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    with Planner(with_limits(attempt_limit=0.05), PROTOTYPES, time_limit=0.08) as planner:
        with pytest.raises(PlanningFailed):
            planner.plan(request())
        assert planner.restarts
        assert any(tmp_path.iterdir())
    assert not any(tmp_path.iterdir())


def test_a_process_that_dies_while_it_plans_is_replaced(planner: Planner) -> None:
    restarts, pid = planner.restarts, planner.pid
    assert pid is not None
    timer = threading.Timer(0.05, os.kill, (pid, signal.SIGKILL))
    timer.start()
    found = planner.plan(request())
    timer.join()
    assert planner.restarts == restarts + 1
    assert found.report.seed_used != "pull"  # the guess that it died with is left out


def test_whatever_goes_wrong_in_its_process_is_told_and_the_next_request_served(
    planner: Planner,
) -> None:
    restarts = planner.restarts
    with pytest.raises(PlanningFailed, match=r"the solver failed: \w+Error: ."):
        planner.plan(request(gamma=np.zeros((4, 1))))
    assert planner.restarts == restarts
    assert planner.plan(request()).report.contact_error <= SETTINGS.check.contact


def test_a_cancelled_plan_ends_at_once_and_the_next_one_works(planner: Planner) -> None:
    begin = time.monotonic()
    with pytest.raises(PlanningCancelled):
        planner.plan(request(), cancelled=lambda: time.monotonic() > begin + 0.1)
    assert planner.plan(request(0.9)).object_joints[-1, 0] > 0.0


def with_limits(**limits: Any) -> PlanningSetup:
    planner = SETTINGS.planner._replace(**limits)
    return replace(SETUP, settings=replace(SETTINGS, planner=planner))


def test_the_time_limit_ends_a_plan() -> None:
    with (
        Planner(with_limits(attempt_limit=0.1), PROTOTYPES, time_limit=0.2) as planner,
        pytest.raises(PlanningFailed, match=r"longer than 0\.1 s; .*the 0\.2 s are over"),
    ):
        planner.plan(request())


def test_a_process_that_does_not_start_is_told() -> None:
    with (
        Planner(with_limits(start_limit=0.0), PROTOTYPES) as planner,
        pytest.raises(PlanningFailed, match="does not start"),
    ):
        planner.plan(request())


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"theta": np.array([np.nan, 0.0, 0.0])}, "not finite"),
        ({"target": -2.5}, "no motion"),
    ],
)
def test_what_cannot_be_planned_has_a_reason(
    planner: Planner, changes: dict[str, Any], reason: str
) -> None:
    with pytest.raises(PlanningFailed, match=reason):
        planner.plan(request(**changes))
