"""What is remembered of a door, and when it is relied upon."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from kmn_skill.execution.door_memory import DoorMemory

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
    np.testing.assert_array_equal(recalled, DOOR)


def test_what_was_relied_upon_anew_has_not_come_to_its_end() -> None:
    memory = DoorMemory()
    memory.interrupted = False
    memory.keep(DOOR, robot(0.0, 0.0))
    assert memory.interrupted
