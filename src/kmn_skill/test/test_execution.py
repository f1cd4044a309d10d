"""A plan is sent in parts that join, and stopped as soon as robot or door do not follow."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from kmn_skill.execution.errors import ExecutionError
from kmn_skill.execution.gripper_commands import gripper_commands
from kmn_skill.execution.plan_execution import Execution, ExecutionSettings, Part, sample
from kmn_skill.execution.states import WorldState
from kmn_skill.planning.plan import Phase, Plan, PlanReport

SETTINGS = ExecutionSettings(
    start_delay=0.3,
    part_duration=2.0,
    part_overlap=0.4,
    hold_duration=0.1,
    settle_time=0.5,
    position_tolerance=0.05,
    angle_tolerance=0.2,
    handle_slip=0.35,
    door_slip=0.2,
)
BEGIN = 100.0  # seconds on the clock of the states
START = BEGIN + SETTINGS.start_delay
NAMES = ("base_x", "base_y", "base_yaw", *(f"arm_{i}" for i in range(7)), "gripper")
SIZES = np.linspace(-1.0, 1.0, 11)


def motion(times: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return smooth positions (T, 11) within 10 seconds, at rest in the beginning and the end."""
    part = times[:, None] / 10.0
    return SIZES * part**2 * (3.0 - 2.0 * part)


def make_plan() -> Plan:
    times = np.arange(101) / 10.0
    part = times[:, None] / 10.0
    door = np.column_stack(
        [np.interp(times, [8, 10], [0, -0.9]), np.interp(times, [6, 8], [0, -0.7])]
    )
    phases = (
        Phase("reach", 0, 40),
        Phase("grasp", 40, 60),
        Phase("press", 60, 80),
        Phase("open", 80, 100),
    )
    report = PlanReport(0.0, 0.01, -0.7, -0.9, 10.0, 1.0, "analytic")
    velocities = SIZES * 0.6 * part * (1.0 - part)
    return Plan(NAMES, times, motion(times), velocities, door, phases, report)


PLAN = make_plan()


def state(time: float) -> WorldState:
    """Return the state of a robot and a door that follow exactly."""
    elapsed = np.clip(time - START, 0.0, 10.0)
    hinge, handle = sample(PLAN.times, PLAN.object_joints, elapsed)
    return WorldState(time, motion(np.array([elapsed]))[0], hinge, handle)


def run(period: float = 0.02, settings: ExecutionSettings = SETTINGS) -> list[tuple[float, Part]]:
    """Follow the plan exactly; return what was sent, and when."""
    execution, sent, now = Execution(PLAN, BEGIN, settings), [], BEGIN
    while True:
        step = execution.step(now, state(now))
        if step.part is not None:
            sent.append((now, step.part))
        if step.finished:
            return sent
        now += period


def test_the_parts_hold_all_points_of_the_plan() -> None:
    for _, part in run():
        assert part.start == START
        np.testing.assert_allclose(part.positions, motion(part.times), atol=1e-9)
    covered = np.concatenate([part.times for _, part in run()])
    np.testing.assert_allclose(np.unique(covered.round(6)), PLAN.times, atol=1e-6)


@pytest.mark.parametrize(
    ("period", "duration"), [(0.004, 0.5), (0.13, 0.5), (0.02, 2.0), (0.9, 3.3), (0.9, 60.0)]
)
def test_each_part_replaces_the_former_without_losing_a_point(
    period: float, duration: float
) -> None:
    """It comes before the former one has to stop, and holds all that is left of it."""
    sent = run(period, replace(SETTINGS, part_duration=duration))
    for (_, former), (time, part) in zip(sent, sent[1:], strict=False):
        assert time <= START + former.times[-1] - SETTINGS.part_overlap
        assert START + part.times[0] <= max(time, START) < START + part.times[1] + 1e-9
        left = former.times[former.times >= part.times[0]]
        np.testing.assert_array_equal(part.times[: len(left)], left)
        assert part.times[-1] > former.times[-1]


def test_each_part_ends_at_rest_and_within_the_plan() -> None:
    for _, part in run():
        assert (np.diff(part.times) > 0.0).all()
        assert (part.velocities[-1] == 0.0).all()
    assert run()[-1][1].times[-1] == pytest.approx(10.0)


def test_a_part_begins_where_a_robot_with_late_states_has_passed() -> None:
    execution = Execution(PLAN, BEGIN, SETTINGS)
    execution.step(BEGIN, state(BEGIN))
    part = execution.step(START + 1.5, state(START + 1.05)).part
    assert part is not None
    assert part.times[0] == pytest.approx(1.0)


def test_it_knows_where_the_robot_is_by_the_parts_that_were_sent() -> None:
    execution = Execution(PLAN, BEGIN, SETTINGS)
    execution.step(BEGIN, state(BEGIN))
    for elapsed, there in ((-0.2, 0.0), (1.55, 1.55), (20.0, 2.4)):
        expected = motion(np.array([there]))[0]
        np.testing.assert_allclose(execution.position(START + elapsed), expected, atol=1e-3)


def test_it_says_where_it_is() -> None:
    execution = Execution(PLAN, BEGIN, SETTINGS)
    for elapsed, phase in ((-0.2, "reach"), (3.9, "reach"), (5.0, "grasp"), (7.0, "press")):
        step = execution.step(START + elapsed, state(START + elapsed))
        found, angles = execution.planned(START + elapsed)
        assert found == phase
        np.testing.assert_allclose(angles, state(START + elapsed)[2:])
        assert step.progress == pytest.approx(max(elapsed, 0.0) / 10.0)
    for elapsed, finished in ((9.0, False), (10.4, False), (10.6, True)):
        step = execution.step(START + elapsed, state(START + elapsed))
        assert (execution.planned(START + elapsed)[0], step.finished) == ("open", finished)


def failure(elapsed: float, **changes: object) -> str:
    execution = Execution(PLAN, BEGIN, SETTINGS)
    with pytest.raises(ExecutionError) as raised:
        execution.step(START + elapsed, state(START + elapsed)._replace(**changes))  # type: ignore[arg-type]
    assert len(str(raised.value)) > 20
    return raised.value.reason


@pytest.mark.parametrize(("joint", "error"), [(0, 0.06), (1, -0.06), (2, 0.21), (9, -0.21)])
def test_a_joint_off_its_trajectory_stops_it(joint: int, error: float) -> None:
    moved = state(START + 5.0).robot.copy()
    moved[joint] += 0.8 * error
    execution = Execution(PLAN, BEGIN, SETTINGS)
    execution.step(START + 5.0, state(START + 5.0)._replace(robot=moved))
    moved[joint] += 0.2 * error
    assert failure(5.0, robot=moved) == "tracking"


def test_a_gripper_that_presses_is_not_off_its_trajectory() -> None:
    robot = state(START + 5.0).robot.copy()
    robot[-1] += 0.5
    Execution(PLAN, BEGIN, SETTINGS).step(START + 5.0, state(START + 5.0)._replace(robot=robot))


def test_a_hand_that_moves_on_without_handle_or_door_stops_it() -> None:
    assert failure(7.9, handle=0.0) == "slipped"
    assert failure(9.5, hinge=0.0) == "slipped"


def test_the_handle_may_spring_back_when_the_door_is_ajar_but_nothing_counts_before() -> None:
    execution = Execution(PLAN, BEGIN, SETTINGS)
    execution.step(START + 3.0, state(START + 3.0)._replace(handle=-0.9, hinge=-1.0))
    execution.step(START + 9.5, state(START + 9.5)._replace(handle=0.0))


def test_states_that_are_old_are_compared_with_what_was_then() -> None:
    # The newest state is half a second old; the robot moved on since then.
    Execution(PLAN, BEGIN, replace(SETTINGS, angle_tolerance=0.01, position_tolerance=0.01)).step(
        START + 5.5, state(START + 5.0)
    )


def test_a_gripper_is_told_each_time_that_it_opens_or_closes() -> None:
    positions = np.array([0.1, 0.1, 0.3, 0.5, 0.5, 0.2, 0.1, 0.101, 0.1, 0.1])[:, None]
    times = np.arange(10.0).astype(np.float64)
    part = Part(100.0, times, positions, np.zeros_like(positions))
    assert gripper_commands(part) == [(101.0, 0.5), (104.0, 0.1)]
    opening = Part(100.0, times[:3], positions[:3], np.zeros((3, 1)))
    assert gripper_commands(opening) == [(101.0, 0.3)]
    assert gripper_commands(part._replace(positions=0.0 * positions)) == []
