"""The buffer of transforms against scipy's composition and slerp, and what it refuses.

Where tf2 is installed, its buffer is held to the same.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from importlib.util import find_spec
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation, Slerp

from kmn_perception.ros.tf2_buffer import Buffer, Tf2Buffer
from kmn_perception.transforms.buffer import TransformBuffer
from kmn_perception.transforms.settings import TransformSettings
from kmn_perception.transforms.transform import Transform, TransformError
from kmn_perception.transforms.watch import TransformWatch

S = 10**9  # a second
CACHE = TransformSettings.load().cache_time
KINDS = [TransformBuffer, Tf2Buffer] if find_spec("tf2_ros") else [TransformBuffer]
MakeBuffer = Callable[[float], Any]
every_buffer = pytest.mark.parametrize("kind", KINDS)

unit = st.floats(-1.0, 1.0)
quaternions = st.tuples(unit, unit, unit, unit).filter(lambda q: np.linalg.norm(q) > 0.1)
places = st.tuples(*[st.floats(-10.0, 10.0)] * 3)


def transform(
    parent: str, child: str, stamp: int = S, place: Any = (0.0, 0.0, 0.0), turn: Any = (0, 0, 0, 1)
) -> Transform:
    turn = tuple((np.array(turn, dtype=float) / np.linalg.norm(turn)).tolist())
    return Transform(parent, child, stamp, place, turn)


def matrix(place: Any, turn: Any) -> NDArray[np.float64]:
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = Rotation.from_quat(turn).as_matrix(), place
    return pose


def reason(buffer: Buffer, target: str, source: str, stamp: int = S) -> str:
    with pytest.raises(TransformError) as error:
        buffer.lookup(target, source, stamp)
    assert str(error.value)
    return error.value.reason


@every_buffer
@given(st.data())
def test_any_two_frames_of_a_tree_are_composed(kind: MakeBuffer, data: st.DataObject) -> None:
    buffer = kind(CACHE)
    poses = {"0": np.eye(4)}  # of all frames in the root
    for number in range(1, data.draw(st.integers(2, 8))):
        parent = data.draw(st.sampled_from(sorted(poses)))
        place, turn = data.draw(places), data.draw(quaternions)
        static = data.draw(st.booleans())
        buffer.set(transform(parent, str(number), S, place, turn), static)
        poses[str(number)] = poses[parent] @ matrix(place, turn)
    target, source = (data.draw(st.sampled_from(sorted(poses))) for _ in range(2))
    expected = np.linalg.inv(poses[target]) @ poses[source]
    np.testing.assert_allclose(buffer.lookup(target, source, S), expected, atol=1e-9)
    latest = buffer.lookup(target, source, 0)
    np.testing.assert_allclose(latest, expected, atol=1e-9)


@every_buffer
@given(st.lists(st.tuples(places, quaternions), min_size=2, max_size=6), st.floats(0.0, 1.0))
def test_motion_is_interpolated(kind: MakeBuffer, told: Any, share: float) -> None:
    buffer = kind(CACHE)
    stamps = [S + i * S // 10 for i in range(len(told))]
    for stamp, (place, turn) in zip(stamps, told, strict=True):
        buffer.set(transform("a", "b", stamp, place, turn))
    at = int(stamps[0] + share * (stamps[-1] - stamps[0]))
    turns = Rotation.from_quat([turn for _, turn in told])
    steps = (turns[:-1].inv() * turns[1:]).magnitude()
    if (steps > np.pi - 1e-3).any():
        return  # by half a turn there are two ways
    expected = np.eye(4)
    expected[:3, :3] = Slerp(stamps, turns)(at).as_matrix()
    line = np.array([place for place, _ in told])
    expected[:3, 3] = [np.interp(at, stamps, line[:, axis]) for axis in range(3)]
    np.testing.assert_allclose(buffer.lookup("a", "b", at), expected, atol=1e-5)


@every_buffer
def test_nothing_is_extrapolated(kind: MakeBuffer) -> None:
    buffer = kind(CACHE)
    buffer.set(transform("world", "base", 5 * S))
    buffer.set(transform("base", "camera"), static=True)
    buffer.lookup("world", "camera", 5 * S)
    for late in (5 * S - 1, 5 * S + 1):  # one alone holds at its own time only
        assert reason(buffer, "world", "camera", late) in ("stale", "too_old")
    buffer.set(transform("world", "base", 6 * S))
    buffer.lookup("camera", "world", 5 * S + 1)
    assert reason(buffer, "world", "camera", 6 * S + 1) == "stale"
    assert reason(buffer, "camera", "world", 5 * S - 1) == "too_old"


@every_buffer
def test_what_is_too_old_is_forgotten_and_not_taken(kind: MakeBuffer) -> None:
    buffer = kind(2.0)
    for second in (1, 2, 3, 9, 10):
        buffer.set(transform("a", "b", second * S))
    buffer.set(transform("a", "b", 3 * S))
    assert reason(buffer, "a", "b", 3 * S) == "too_old"
    buffer.lookup("a", "b", 9 * S)


@every_buffer
def test_the_order_of_arrival_does_not_count(kind: MakeBuffer) -> None:
    buffer = kind(CACHE)
    for second in (3, 1, 4, 2):
        buffer.set(transform("a", "b", second * S, (float(second), 0.0, 0.0)))
    assert buffer.lookup("a", "b", 5 * S // 2)[0, 3] == pytest.approx(2.5)


@every_buffer
def test_the_latest_is_when_all_is_known(kind: MakeBuffer) -> None:
    buffer = kind(CACHE)
    for second in (1, 2, 3):
        buffer.set(transform("a", "b", second * S, (float(second), 0.0, 0.0)))
    for second in (1, 2):
        buffer.set(transform("b", "c", second * S, (0.0, float(second), 0.0)))
    np.testing.assert_allclose(buffer.lookup("a", "c", 0)[:2, 3], [2.0, 2.0])
    np.testing.assert_allclose(buffer.lookup("a", "b", 0)[0, 3], 3.0)


@every_buffer
def test_what_is_static_holds_at_all_times_and_is_replaced(kind: MakeBuffer) -> None:
    buffer = kind(CACHE)
    buffer.set(transform("a", "b", 100 * S, (1.0, 0.0, 0.0)), static=True)
    assert buffer.lookup("a", "b", S)[0, 3] == 1.0
    buffer.set(transform("c", "b", 100 * S, (2.0, 0.0, 0.0)), static=True)
    assert buffer.lookup("c", "b", S)[0, 3] == 2.0
    assert reason(buffer, "a", "b") == "disconnected"


@every_buffer
def test_reasons_why_there_is_none(kind: MakeBuffer) -> None:
    buffer = kind(CACHE)
    buffer.set(transform("map", "odom"))
    buffer.set(transform("head", "camera"))
    assert reason(buffer, "map", "nowhere") == "unknown_frame"
    assert reason(buffer, "nowhere", "camera") == "unknown_frame"
    assert reason(buffer, "map", "camera") == "disconnected"
    for parent, child in (("a", "b"), ("b", "c"), ("c", "a")):
        buffer.set(transform(parent, child))
    assert reason(buffer, "map", "c") == "loop"


@every_buffer
def test_what_is_above_both_frames_need_not_be_known(kind: MakeBuffer) -> None:
    buffer = kind(CACHE)
    buffer.set(transform("map", "base", 50 * S))
    buffer.set(transform("base", "left", place=(0.0, 1.0, 0.0)), static=True)
    buffer.set(transform("base", "right", place=(0.0, -1.0, 0.0)), static=True)
    assert buffer.lookup("left", "right", S)[1, 3] == -2.0


@every_buffer
def test_of_two_parents_in_turn_the_older_one_holds(kind: MakeBuffer) -> None:
    buffer = kind(CACHE)
    buffer.set(transform("a", "c", S, (1.0, 0.0, 0.0)))
    buffer.set(transform("b", "c", 2 * S, (2.0, 0.0, 0.0)))
    assert buffer.lookup("a", "c", 3 * S // 2)[0, 3] == 1.0


@pytest.mark.parametrize(
    "bad",
    [
        Transform("", "b", S, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)),
        Transform("a", "", S, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)),
        Transform("a", "a", S, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)),
        Transform("a", "b", S, (math.nan, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)),
        Transform("a", "b", S, (0.0, 0.0, 0.0), (0.0, math.inf, 0.0, 1.0)),
        Transform("a", "b", S, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0)),
        Transform("a", "b", S, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.1)),
    ],
)
def test_what_is_no_transform_is_refused(bad: Transform) -> None:
    with pytest.raises(TransformError) as error:
        bad.check()
    assert error.value.reason == "invalid"


@pytest.fixture
def watch() -> TransformWatch:
    return TransformWatch(TransformSettings.load())


def doubt(watch: TransformWatch, stamp: int) -> str:
    try:
        watch.check("world", "camera", stamp)
    except TransformError as error:
        return error.reason
    return ""


def test_a_pause_is_doubtful_if_the_frame_moved_meanwhile(watch: TransformWatch) -> None:
    watch.see(transform("base", "camera"), static=True)
    for second, x in ((1, 0.0), (5, 0.001), (6, 0.3), (7, 0.3)):
        watch.see(transform("world", "base", second * S, (x, 0.0, 0.0)))
    assert not doubt(watch, 3 * S)
    assert doubt(watch, 11 * S // 2) == "gap"
    assert not doubt(watch, 6 * S)
    turned = (0.0, 0.0, math.sin(0.05), math.cos(0.05))
    watch.see(transform("world", "base", 8 * S, (0.3, 0.0, 0.0), turned))
    assert doubt(watch, 15 * S // 2) == "gap"
    watch.see(transform("world", "base", 9 * S, (0.3, 0.0, 0.0), [-q for q in turned]))
    assert not doubt(watch, 17 * S // 2)  # a quaternion and its negative are one rotation


def test_parents_in_turn_are_two_and_one_change_is_none(watch: TransformWatch) -> None:
    watch.see(transform("world", "camera", 1 * S))
    watch.see(transform("base", "camera", 2 * S))
    assert not doubt(watch, 2 * S)
    watch.see(transform("world", "camera", 3 * S))
    assert doubt(watch, 3 * S) == "two_parents"
    for second in range(4, 15):
        watch.see(transform("world", "camera", second * S))
    assert not doubt(watch, 14 * S)


def test_two_who_tell_other_parents_of_a_resting_frame_are_noticed(watch: TransformWatch) -> None:
    watch.see(transform("world", "camera"), static=True)
    watch.see(transform("base", "camera"), static=True, alone=True)
    assert not doubt(watch, S)
    watch.see(transform("world", "camera"), static=True, alone=False)
    assert doubt(watch, S) == "two_parents"


def test_time_that_goes_back_is_told_apart_from_disorder(watch: TransformWatch) -> None:
    watch.see(transform("world", "base", 9 * S))
    assert not watch.see(transform("world", "base", 9 * S - S // 10))
    assert watch.see(transform("world", "base", 2 * S))
    assert not watch.see(transform("world", "base", 2 * S + S // 10))
