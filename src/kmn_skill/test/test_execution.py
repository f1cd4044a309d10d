"""A plan is sent in parts that join, and stopped as soon as robot or door do not follow."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from kmn_skill.execution.errors import ExecutionError
from kmn_skill.execution.plan_execution import Execution, ExecutionSettings, Part, sample
from kmn_skill.execution.states import WorldState
from kmn_skill.planning.plan import Phase, Plan, PlanReport

SETTINGS = ExecutionSettings(
    start_delay=0.3,
    part_duration=2.0,
    part_overlap=0.4,
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
    hinge, handle = sample(PLAN.times, PLAN.door, elapsed)
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
    starts = [part.start - START for _, part in run()]
    np.testing.assert_allclose(starts, [0.0, 2.0, 4.0, 6.0, 8.0], atol=1e-9)
    for _, part in run():
        times = part.times + part.start - START
        np.testing.assert_allclose(part.positions, motion(times), atol=1e-9)
    covered = np.concatenate([part.times + part.start - START for _, part in run()])
    np.testing.assert_allclose(np.unique(covered.round(6)), PLAN.times[1:], atol=1e-6)


@pytest.mark.parametrize(
    ("period", "duration"), [(0.004, 0.5), (0.13, 0.5), (0.02, 2.0), (0.9, 3.3), (0.9, 60.0)]
)
def test_each_part_comes_after_the_former_began_and_before_it_ends(
    period: float, duration: float
) -> None:
    sent = run(period, replace(SETTINGS, part_duration=duration))
    for (_, former), (time, part) in zip(sent, sent[1:], strict=False):
        assert former.start <= time <= part.start
        end = min(part.start + SETTINGS.part_overlap, START + 10.0)
        assert end <= former.start + former.times[-1] + 1e-9


def test_each_part_ends_at_rest_and_within_the_plan() -> None:
    for _, part in run():
        assert (part.times > 0.0).all()
        assert (np.diff(part.times) > 0.0).all()
        assert (part.velocities[-1] == 0.0).all()
    last = run()[-1][1]
    assert last.start + last.times[-1] == pytest.approx(START + 10.0)


def test_it_says_where_it_is() -> None:
    execution = Execution(PLAN, BEGIN, SETTINGS)
    for elapsed, phase in ((-0.2, "reach"), (3.9, "reach"), (5.0, "grasp"), (7.0, "press")):
        step = execution.step(START + elapsed, state(START + elapsed))
        assert step.phase == phase
        assert step.progress == pytest.approx(max(elapsed, 0.0) / 10.0)
    for elapsed, finished in ((9.0, False), (10.4, False), (10.6, True)):
        step = execution.step(START + elapsed, state(START + elapsed))
        assert (step.phase, step.finished) == ("open", finished)


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
