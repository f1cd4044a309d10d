"""States that stop, jump or go back in time are noticed."""

from __future__ import annotations

import threading
import time

import numpy as np
import pytest

from kmn_skill.execution.errors import StatesError
from kmn_skill.execution.states import Sample, StateSettings, StateWatch

SETTINGS = StateSettings(state_timeout=1.0, max_speed=4.0, max_jump=0.1)
JOINTS = {"joint_states": ("base_x", "arm"), "door_state": ("hinge", "handle")}


class SteadyClock:
    """A clock that the test sets."""

    time = 0.0

    def __call__(self) -> float:
        return self.time


@pytest.fixture
def clock() -> SteadyClock:
    return SteadyClock()


@pytest.fixture
def watch(clock: SteadyClock) -> StateWatch:
    made = StateWatch(SETTINGS, JOINTS, clock)
    made.put("joint_states", Sample(10.0, np.array([1.0, 2.0])))
    made.put("door_state", Sample(10.0, np.array([-0.1, -0.2])))
    return made


def reason(watch: StateWatch, now: float) -> str:
    with pytest.raises(StatesError) as raised:
        watch.newest(now, watch.breaks)
    return raised.value.reason


def test_the_newest_state_is_that_of_robot_and_door(watch: StateWatch) -> None:
    state = watch.newest(10.1, watch.breaks)
    assert (state.time, *state.robot, state.hinge, state.handle) == (10.0, 1.0, 2.0, -0.1, -0.2)


def test_both_are_needed() -> None:
    watch = StateWatch(SETTINGS, JOINTS)
    assert reason(watch, 0.0) == "no_states"
    watch.put("joint_states", Sample(0.0, np.zeros(2)))
    assert reason(watch, 0.0) == "no_states"


@pytest.mark.parametrize("now", [11.5, 8.5])
def test_stamps_of_another_time_are_stale(watch: StateWatch, now: float) -> None:
    assert reason(watch, now) == "stale_states"


def test_silence_is_noticed_although_the_clock_of_the_states_stands_still(
    watch: StateWatch, clock: SteadyClock
) -> None:
    clock.time = 1.5
    assert reason(watch, 10.0) == "states_stopped"


def test_a_motion_is_no_break(watch: StateWatch) -> None:
    watch.put("joint_states", Sample(10.5, np.array([3.0, 0.0])))
    watch.put("door_state", Sample(10.02, np.array([-0.15, -0.2])))
    assert watch.breaks == 0


def test_a_handle_that_springs_back_is_no_break(watch: StateWatch) -> None:
    watch.put("door_state", Sample(10.02, np.array([-0.1, 0.5])))
    assert watch.breaks == 0


@pytest.mark.parametrize(
    ("topic", "sample", "text"),
    [
        ("joint_states", Sample(10.02, np.array([1.0, 2.5])), "arm jumped by 0.50"),
        ("door_state", Sample(10.02, np.array([-0.9, -0.2])), "hinge jumped by 0.80"),
        ("joint_states", Sample(0.02, np.array([1.0, 2.0])), "went back by 9.98 s"),
    ],
)
def test_jumps_and_times_that_go_back_are_breaks(
    watch: StateWatch, topic: str, sample: Sample, text: str
) -> None:
    watch.put(topic, sample)
    assert watch.breaks == 1
    assert text in watch.last_break


def test_waiting_ends_with_the_next_state(watch: StateWatch) -> None:
    sample = Sample(10.1, np.array([1.0, 2.0]))
    timer = threading.Timer(0.05, watch.put, ("joint_states", sample))
    timer.start()
    before = time.monotonic()
    watch.wait(60.0)
    assert time.monotonic() - before < 30.0
    assert watch.newest(10.1, watch.breaks).time == 10.1


def test_the_first_state_of_another_world_is_not_given_as_one_of_this(watch: StateWatch) -> None:
    """However late the jump comes, even while the caller asks for the time."""
    known = watch.breaks

    def now() -> float:
        watch.put("joint_states", Sample(10.1, np.array([3.0, 2.0])))
        return 10.1

    with pytest.raises(StatesError, match="base_x jumped by 2.00") as raised:
        watch.newest(now(), known)
    assert raised.value.reason == "another_world"


def test_a_joint_that_turns_on_and_on_may_be_told_within_a_turn() -> None:
    """Past half a turn others tell it at the other end; of a joint with limits that is a jump."""
    watch = StateWatch(SETTINGS, JOINTS, continuous=("arm",))
    for count in range(100):
        angle = 0.1 * count
        told = (angle + np.pi) % (2.0 * np.pi) - np.pi
        watch.put("joint_states", Sample(0.1 * count, np.array([0.0, told])))
        robot = watch.robot(0.1 * count, 1.0)
        assert robot is not None
        np.testing.assert_allclose(robot.positions, [0.0, angle], atol=1e-9)
    assert watch.breaks == 0
    watch.put("joint_states", Sample(10.0, np.array([0.0, 9.9 - np.pi])))
    watch.put("joint_states", Sample(10.1, np.array([2.0 * np.pi, 9.9])))
    assert watch.breaks == 2


def test_where_the_robot_is_is_known_only_from_recent_states(
    watch: StateWatch, clock: SteadyClock
) -> None:
    known = watch.robot(10.1, 0.2)
    assert known is not None
    np.testing.assert_array_equal(known.positions, [1.0, 2.0])
    assert watch.robot(10.3, 0.2) is None
    clock.time = 0.3
    assert watch.robot(10.1, 0.2) is None
    assert StateWatch(SETTINGS, JOINTS).robot(0.0, 1.0) is None


def test_where_nobody_tells_the_doors_angles_the_robot_is_enough() -> None:
    watch = StateWatch(SETTINGS, {"joint_states": JOINTS["joint_states"]})
    watch.put("joint_states", Sample(10.0, np.array([1.0, 2.0])))
    state = watch.newest(10.1, watch.breaks)
    assert not watch.tells_door
    assert np.isnan([state.hinge, state.handle]).all()
