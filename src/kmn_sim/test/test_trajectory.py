"""What trajectories are refused, and how the others are followed, case by case."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kmn_sim.control.interpolation import State
from kmn_sim.control.trajectory import Command, TrajectoryError, Waypoint
from kmn_sim.control.trajectory_controller import TrajectoryController

LIMITS = {"a": (-1.0, 1.0), "b": (-2.0, 2.0)}
NAMES = ("a", "b")
HERE = State.at_rest(np.array([0.0, 0.5]))
NAN, INF = math.nan, math.inf


def controller(
    from_desired_state: bool = True, allow_partial: bool = False
) -> TrajectoryController:
    nowhere = np.zeros(2, bool)
    return TrajectoryController(LIMITS, HERE.positions, nowhere, from_desired_state, allow_partial)


def line(*points: tuple[float, float, float], start: float | None = None) -> Command:
    """Return a command of points (time, a, b)."""
    return Command(NAMES, [Waypoint(t, (a, b)) for t, a, b in points], start)


def position(of: TrajectoryController, now: float, measured: State = HERE) -> list[float]:
    return [float(value) for value in of.sample(now, measured).positions]


def near(*values: float) -> object:
    return pytest.approx(list(values), abs=1e-9)


def test_without_a_trajectory_it_holds() -> None:
    assert position(controller(), 5.0) == near(0.0, 0.5)


def test_points_are_reached_at_their_times_and_the_last_one_is_held() -> None:
    it = controller()
    it.accept(line((1.0, 0.4, 0.5), (3.0, 0.8, -0.5)), 10.0)
    assert position(it, 10.0) == near(0.0, 0.5)
    assert position(it, 10.5) == near(0.2, 0.5)
    assert position(it, 11.0) == near(0.4, 0.5)
    assert position(it, 12.0) == near(0.6, 0.0)
    assert position(it, 13.0) == near(0.8, -0.5)
    assert position(it, 99.0) == near(0.8, -0.5)
    assert it.sample(99.0, HERE).velocities == near(0.0, 0.0)


def test_a_first_point_at_time_zero_is_taken_at_once() -> None:
    it = controller()
    it.accept(line((0.0, 0.4, 0.4), (1.0, 0.6, 0.4)), 2.0)
    assert position(it, 2.0) == near(0.4, 0.4)
    assert position(it, 2.5) == near(0.5, 0.4)


def test_velocities_make_it_cubic() -> None:
    it = controller()
    it.accept(Command(NAMES, [Waypoint(2.0, (1.0, 0.5), (0.0, 0.0))]), 0.0)
    position(it, 0.0)
    assert position(it, 0.5) == near(3 * 0.25**2 - 2 * 0.25**3, 0.5)
    assert it.sample(1.0, HERE).velocities == near(0.75, 0.0)


def test_a_start_in_the_future_replaces_the_running_one_at_once() -> None:
    """It leads from the present state to its first point, which is due at 2 + 3 + 1 s."""
    it = controller()
    it.accept(line((10.0, 1.0, 0.5)), 0.0)
    position(it, 0.0)
    it.accept(line((1.0, 0.6, 0.5), (2.0, 0.0, 0.5), start=5.0), 2.0)
    assert position(it, 2.0) == near(0.2, 0.5)
    assert position(it, 4.0) == near(0.4, 0.5)
    assert position(it, 6.0) == near(0.6, 0.5)
    assert position(it, 6.5) == near(0.3, 0.5)
    assert position(it, 9.0) == near(0.0, 0.5)


def test_one_that_has_not_begun_is_replaced_too() -> None:
    it = controller()
    it.accept(line((1.0, 1.0, 0.5), start=5.0), 0.0)
    it.accept(line((0.0, -1.0, 0.5), start=4.0), 0.0)
    assert position(it, 0.0) == near(0.0, 0.5)
    assert position(it, 2.0) == near(-0.5, 0.5)
    assert position(it, 6.0) == near(-1.0, 0.5)


def test_with_points_in_the_past_it_is_followed_from_where_it_is() -> None:
    it = controller()
    it.accept(line((1.0, 1.0, 2.0), (3.0, 0.4, 0.0), (4.0, 0.0, 0.0), start=8.0), 10.0)
    assert position(it, 10.0) == near(0.7, 1.0)
    assert position(it, 10.5) == near(0.55, 0.5)
    assert position(it, 11.0) == near(0.4, 0.0)


def test_the_rest_of_the_running_one_with_more_points_changes_nothing() -> None:
    """As long as the new one begins with a point that has passed."""
    it, undisturbed = controller(), controller()
    points = [(t, 0.1 * t**2 - 1.0, 1.0 - 0.2 * t) for t in (1.0, 1.5, 2.0, 3.0, 4.0)]
    undisturbed.accept(line(*points, start=10.0), 9.0)
    it.accept(line(*points[:3], start=10.0), 9.0)
    for now in np.arange(9.0, 15.0, 0.1).tolist():
        if 11.6 < now < 11.75:
            it.accept(line(*points[1:], start=10.0), now)
        assert position(it, now) == near(*position(undisturbed, now))


@pytest.mark.parametrize("from_desired_state", [True, False])
def test_replacement_goes_on_from_the_present_state(from_desired_state: bool) -> None:
    it = controller(from_desired_state)
    it.accept(line((10.0, 1.0, 0.5)), 0.0)
    position(it, 0.0)
    behind = State.at_rest(np.array([0.3, 0.5]))
    assert position(it, 5.0, behind) == near(0.5, 0.5)
    it.accept(line((2.0, -0.5, 0.5)), 5.0)
    start = 0.5 if from_desired_state else 0.3
    assert position(it, 5.0, behind) == near(start, 0.5)
    assert position(it, 6.0, behind) == near((start - 0.5) / 2.0, 0.5)


@pytest.mark.parametrize("from_desired_state", [True, False])
def test_one_point_at_once_is_a_hold(from_desired_state: bool) -> None:
    it = controller(from_desired_state)
    it.accept(line((10.0, 1.0, 0.5)), 0.0)
    position(it, 0.0)
    assert position(it, 5.0) == near(0.5, 0.5)
    it.accept(line((0.0, 0.45, 0.5)), 5.0)
    for now in (5.0, 5.1, 10.0):
        assert position(it, now) == near(0.45, 0.5)
        assert it.sample(now, HERE).velocities == near(0.0, 0.0)


def test_a_hold_a_little_beyond_a_limit_is_a_hold_at_the_limit() -> None:
    it = controller()
    it.accept(line((0.0, 1.01, 0.5)), 0.0)
    assert position(it, 0.0) == near(1.0, 0.5)


@pytest.mark.parametrize("velocities", [(), (0.0,)])
def test_joints_that_are_not_named_hold(velocities: tuple[float, ...]) -> None:
    it = controller(allow_partial=True)
    it.accept(Command(("b",), [Waypoint(2.0, (-1.5,), velocities)]), 0.0)
    position(it, 0.0)
    assert position(it, 1.0) == near(0.0, -0.5)
    assert position(it, 2.0) == near(0.0, -1.5)


def test_joints_come_in_any_order() -> None:
    it = controller()
    it.accept(Command(("b", "a"), [Waypoint(1.0, (-1.0, 0.7))]), 0.0)
    position(it, 0.0)
    assert position(it, 1.0) == near(0.7, -1.0)


def test_a_joint_that_turns_on_and_on_goes_the_shorter_way() -> None:
    """From 0 to a position that is a turn and a bit away, of the first joint but not the second."""
    limits = dict.fromkeys(NAMES, (-99.0, 99.0))
    it = TrajectoryController(limits, np.zeros(2), np.array([True, False]), True, False)
    there = 2.0 * np.pi + 0.2
    it.accept(line((2.0, there, there)), 0.0)
    assert position(it, 0.0) == near(2.0 * np.pi, 0.0)
    assert position(it, 1.0) == near(2.0 * np.pi + 0.1, there / 2.0)
    assert position(it, 2.0) == near(there, there)


def test_progress_goes_from_0_to_1() -> None:
    it = controller()
    assert it.progress(0.0) is None
    it.accept(line((2.0, 0.4, 0.5), (4.0, 0.8, 0.5)), 10.0)
    position(it, 10.0)
    assert [it.progress(now) for now in (10.0, 11.0, 14.0, 20.0)] == [0.0, 0.25, 1.0, 1.0]


REFUSED = {
    "unknown_joint": Command(("a", "c"), [Waypoint(1.0, (0.0, 0.0))]),
    "joint_names": Command(("a", "a"), [Waypoint(1.0, (0.0, 0.0))]),
    "empty": Command((), ()),
    "empty of joints": Command((), [Waypoint(1.0, ())]),
    "empty of points": Command(NAMES, ()),
    "partial": Command(("b",), [Waypoint(1.0, (0.0,))]),
    "lengths": Command(NAMES, [Waypoint(1.0, (0.0,))]),
    "lengths of none": Command(NAMES, [Waypoint(1.0, ())]),
    "lengths of velocities": Command(NAMES, [Waypoint(1.0, (0.0, 0.0), (0.0,))]),
    "lengths of accelerations": Command(NAMES, [Waypoint(1.0, (0.0, 0.0), (), (0.0,) * 3)]),
    "times": line((1.0, 0.1, 0.1), (1.0, 0.2, 0.2)),
    "times backwards": line((1.0, 0.1, 0.1), (0.5, 0.2, 0.2)),
    "times before the start": line((-0.1, 0.1, 0.1)),
    "not_finite": line((1.0, NAN, 0.0)),
    "not_finite, infinite": line((1.0, 0.0, INF)),
    "not_finite velocity": Command(NAMES, [Waypoint(1.0, (0.0, 0.0), (0.0, NAN))]),
    "out_of_limits": line((1.0, 0.0, 0.0), (2.0, 1.03, 0.0)),
    "effort": Command(NAMES, [Waypoint(1.0, (0.0, 0.0), (), (), (1.0, 1.0))]),
    "moving_end": Command(NAMES, [Waypoint(1.0, (0.0, 0.0), (0.1, 0.0))]),
    "in_the_past": line((1.0, 0.0, 0.0), (2.0, 0.0, 0.0), start=97.9),
}


@pytest.mark.parametrize("case", REFUSED)
def test_a_wrong_trajectory_is_refused_and_nothing_changes(case: str) -> None:
    it, undisturbed = controller(), controller()
    for each in (it, undisturbed):
        each.accept(line((10.0, 1.0, -0.5)), 99.0)
        position(each, 99.0)
    with pytest.raises(TrajectoryError) as error:
        it.accept(REFUSED[case], 100.0)
    assert error.value.reason == case.replace(",", " ").split()[0]
    for now in (100.0, 104.0, 120.0):
        assert position(it, now) == position(undisturbed, now)


point = st.tuples(st.floats(0.01, 3.0), st.floats(-1.0, 1.0), st.floats(-2.0, 2.0))
starts = st.none() | st.floats(0.0, 20.0)


@given(st.lists(st.tuples(st.lists(point, min_size=1, max_size=4), starts), max_size=5))
def test_no_sequence_of_commands_makes_it_jump_or_leave_the_limits(
    commands: list[tuple[list[tuple[float, float, float]], float | None]],
) -> None:
    it, step = controller(), 0.01
    before = np.array(position(it, 0.0))
    for number, (points, start) in enumerate(commands):
        times = np.cumsum([0.2 + p[0] for p in points])
        now = 3.0 * number
        try:
            moved = [(float(t), a, b) for t, (_, a, b) in zip(times, points, strict=True)]
            it.accept(line(*moved, start=start), now)
        except TrajectoryError as error:
            assert error.reason == "in_the_past"
        last_time = now
        for later in np.arange(0.0, 3.0, step):
            now = 3.0 * number + float(later)
            present = np.array(position(it, now))
            assert (np.abs(present) <= [1.0, 2.0]).all()
            # A start in the past may leave next to no time to the first point that is left.
            if start is None:
                assert np.abs(present - before).max() <= 4.0 * (now - last_time + step) / 0.2 + 1e-9
            before, last_time = present, now
