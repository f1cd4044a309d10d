"""What is remembered of a door, and when it is relied upon."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from kmn_skill.execution.door_memory import DoorMemory, Grip

DOOR: NDArray[np.float64] = np.arange(7, dtype=np.float64)
metres = st.floats(-5.0, 5.0)


def robot(x: float, y: float) -> NDArray[np.float64]:
    return np.array([x, y, *np.zeros(9)], dtype=np.float64)


def test_nothing_is_recalled_before_it_was_kept_and_after_it_was_forgotten() -> None:
    memory = DoorMemory()
    assert memory.recall(robot(9.0, 9.0), 0.1) is None
    memory.keep(DOOR, robot(0.0, 0.0))
    memory.forget()
    assert memory.recall(robot(9.0, 9.0), 0.1) is None


@given(metres, metres, metres, metres, st.floats(0.0, 5.0))
def test_the_door_is_recalled_once_the_robot_has_driven(
    x: float, y: float, to_x: float, to_y: float, distance: float
) -> None:
    memory = DoorMemory()
    memory.keep(DOOR, robot(x, y))
    recalled = memory.recall(robot(to_x, to_y), distance)
    assert (recalled is not None) == (np.hypot(to_x - x, to_y - y) > distance)


def test_what_was_seen_last_is_recalled() -> None:
    memory = DoorMemory()
    memory.keep(DOOR + 1.0, robot(0.0, 0.0))
    memory.keep(DOOR, robot(1.0, 0.0))
    recalled = memory.recall(robot(2.0, 0.0), 0.1)
    assert recalled is not None
    np.testing.assert_array_equal(recalled.values, DOOR)


def test_what_was_relied_upon_anew_has_not_come_to_its_end() -> None:
    memory = DoorMemory()
    memory.keep(DOOR, robot(0.0, 0.0))
    memory.reach_goal()
    assert [memory.kept is None, memory.kept and memory.kept.interrupted] == [False, False]
    memory.keep(DOOR, robot(0.0, 0.0))
    assert memory.kept is not None and memory.kept.interrupted


POINTS = np.arange(6, dtype=np.float64).reshape(2, 3)
GRIP = Grip(POINTS, 0.05)
SHAPE = (7, 11)


def test_another_program_remembers_what_was_kept(tmp_path: Path) -> None:
    file = tmp_path / "new" / "door.json"
    memory = DoorMemory(file)
    memory.keep(DOOR, robot(1.0, 2.0), 100.0)
    memory.keep_grip(GRIP)
    other = DoorMemory(file)
    other.restore(160.0, 60.0, SHAPE)
    assert other.kept is not None and other.kept.grip is not None
    np.testing.assert_array_equal(other.kept.values, DOOR)
    np.testing.assert_array_equal(other.kept.robot, robot(1.0, 2.0))
    np.testing.assert_array_equal(other.kept.grip.points, GRIP.points)
    assert (other.kept.grip.width, other.kept.time, other.kept.interrupted) == (0.05, 100.0, True)
    other.forget()
    assert not file.exists()


@pytest.mark.parametrize("now", [99.0, 160.1])
def test_what_is_too_old_or_of_another_clock_is_not_remembered(tmp_path: Path, now: float) -> None:
    file = tmp_path / "door.json"
    DoorMemory(file).keep(DOOR, robot(0.0, 0.0), 100.0)
    other = DoorMemory(file)
    other.restore(now, 60.0, SHAPE)
    assert other.kept is None


DOUBTFUL = {
    "grip": None,
    "values": [0.0] * 7,
    "robot": [0.0] * 11,
    "time": 1.0,
    "interrupted": True,
}


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("", "JSONDecodeError"),
        ("[]", "is no door that was kept"),
        ('{"grip": null}', "KeyError"),
        ('{"grip": {"points": [1], "width": 1}}', "reshape"),
        (json.dumps({**DOUBTFUL, "values": [0.0]}), "holds 1 parameters and 11 joints"),
        (json.dumps({**DOUBTFUL, "robot": [[0.0] * 11]}), "expected 7 and 11"),
        (json.dumps({**DOUBTFUL, "values": [float("nan")] * 7}), "not finite"),
    ],
)
def test_a_file_that_is_none_is_told(tmp_path: Path, text: str, expected: str) -> None:
    file, told = tmp_path / "door.json", list[str]()
    file.write_text(text)
    memory = DoorMemory(file, told.append)
    for _ in range(3):
        memory.restore(1.0, 60.0, SHAPE)
    assert memory.kept is None
    [reason] = told  # once
    assert expected in reason
    assert str(file) in reason


def test_a_folder_that_cannot_be_written_is_told_and_the_door_is_kept(tmp_path: Path) -> None:
    blocked, told = tmp_path / "file", list[str]()
    blocked.write_text("no folder")
    memory = DoorMemory(blocked / "door.json", told.append)
    memory.keep(DOOR, robot(0.0, 0.0), 1.0)
    assert memory.kept is not None
    [reason] = told
    assert "not be known after a restart" in reason
