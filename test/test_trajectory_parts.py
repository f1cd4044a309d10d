"""What skill_node sends in parts, a strict controller joins to one smooth motion."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from kmn_sim.control.interpolation import State
from kmn_sim.control.trajectory_controller import TrajectoryController
from kmn_sim.ros.messages import command_from_message
from kmn_skill.execution.plan_execution import Execution, ExecutionSettings
from kmn_skill.execution.states import WorldState
from kmn_skill.planning.plan import Phase, Plan, PlanReport
from kmn_skill.ros.messages import trajectory_from_part

STEP = 1.0 / 240.0  # seconds; of the physics
NAMES = ("base_x", "base_y")
SETTINGS = ExecutionSettings(
    start_delay=0.3,
    part_duration=1.0,
    part_overlap=0.3,
    hold_duration=0.1,
    settle_time=0.1,
    position_tolerance=0.05,
    angle_tolerance=0.2,
    handle_slip=0.3,
    door_slip=0.3,
)
REPORT = PlanReport(0.0, 0.0, 0.0, 0.0, 6.0, 0.0, "analytic")


def position(times: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return positions (T, 2) on two circles that begin and end at rest, after 6 seconds."""
    return np.column_stack([1.0 - np.cos(np.pi * times / 3.0), np.cos(np.pi * times / 6.0)])


def make_plan() -> Plan:
    times: NDArray[np.float64] = np.arange(61) / 10.0
    velocities = np.column_stack(
        [np.pi / 3.0 * np.sin(np.pi * times / 3.0), -np.pi / 6.0 * np.sin(np.pi * times / 6.0)]
    )
    phases = (Phase("reach", 0, 60),)
    return Plan(NAMES, times, position(times), velocities, np.zeros((61, 2)), phases, REPORT)


def make_controller(start: NDArray[np.float64], from_desired: bool) -> TrajectoryController:
    limits = dict.fromkeys(NAMES, (-10.0, 10.0))
    return TrajectoryController(limits, start, np.zeros(2, bool), from_desired, False)


@pytest.mark.parametrize("from_desired_state", [True, False])
@pytest.mark.parametrize("period", [STEP, 0.05, 0.3])
def test_the_controller_follows_the_plan_across_its_parts(
    period: float, from_desired_state: bool
) -> None:
    """The splines through points on circles 0.1 s apart stay within 30 um of these circles.

    A robot that stays behind its desired state does not matter, though each part begins anew.
    """
    start = position(np.zeros(1))[0]
    controller = make_controller(start, from_desired_state)
    begin = 50.0
    execution = Execution(make_plan(), begin, SETTINGS)
    desired, due = State.at_rest(start), begin
    for step in range(round(6.3 / STEP)):
        now = begin + step * STEP
        if now >= due:
            due += period
            part = execution.step(now, WorldState(now, desired.positions, 0.0, 0.0)).part
            if part is not None:
                message = trajectory_from_part(part, NAMES)
                controller.accept(command_from_message(message, lambda stamp: stamp), now)
        behind = State(desired.positions - 0.01, desired.velocities, desired.accelerations)
        measured = desired if now < begin + SETTINGS.start_delay else behind
        before, desired = desired, controller.sample(now, measured)
        elapsed = np.clip(now - begin - SETTINGS.start_delay, 0.0, 6.0)
        expected = position(np.array([elapsed]))[0]
        np.testing.assert_allclose(desired.positions, expected, atol=3e-5)
        assert np.abs(desired.velocities - before.velocities).max() < 2.0 * STEP


def test_a_part_after_which_none_comes_ends_at_rest_within_its_overlap() -> None:
    start = position(np.zeros(1))[0]
    controller = make_controller(start, from_desired=True)
    execution = Execution(make_plan(), 0.0, SETTINGS)
    part = execution.step(0.0, WorldState(0.0, start, 0.0, 0.0)).part
    assert part is not None
    controller.accept(
        command_from_message(trajectory_from_part(part, NAMES), lambda stamp: stamp), 0.0
    )
    desired = State.at_rest(start)
    for step in range(round(3.0 / STEP)):
        desired = controller.sample(step * STEP, desired)
    np.testing.assert_allclose(desired.positions, position(np.array([1.3]))[0], atol=1e-9)
    assert (desired.velocities == 0.0).all()
