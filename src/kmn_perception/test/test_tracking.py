"""Numbers of objects: the same for those that stay, whatever their order and noise."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from kmn_perception.scene.tracking import ObjectTracker

DISTANCE = 0.05
MEMORY = 30  # frames
PLACES = np.array([[0.0, 0.0, 0.1], [0.2, 0.0, 0.1], [0.0, 0.3, 0.05], [0.2, 0.3, 0.1]])


@given(st.permutations(range(len(PLACES))), st.integers(0, 2**31))
def test_objects_that_rest_keep_their_numbers_in_any_order(order: list[int], seed: int) -> None:
    tracker = ObjectTracker(DISTANCE, MEMORY)
    first = tracker.update(list(PLACES))
    assert sorted(first) == [1, 2, 3, 4]
    noise = np.random.default_rng(seed).uniform(-0.02, 0.02, PLACES.shape)
    again = tracker.update(list((PLACES + noise)[order]))
    assert again == [first[i] for i in order]


def test_an_object_that_was_hidden_for_a_while_comes_back_with_its_number() -> None:
    tracker = ObjectTracker(DISTANCE, MEMORY)
    numbers = tracker.update(list(PLACES))
    for _ in range(MEMORY - 1):
        assert tracker.update(list(PLACES[1:])) == numbers[1:]
    assert tracker.update(list(PLACES)) == numbers
    for _ in range(MEMORY + 1):
        tracker.update(list(PLACES[1:]))
    assert tracker.update(list(PLACES)) == [5, *numbers[1:]]


def test_of_two_objects_the_nearer_one_takes_the_number() -> None:
    tracker = ObjectTracker(DISTANCE, MEMORY)
    tracker.update([PLACES[0]])
    moved = [PLACES[0] + [0.03, 0.0, 0.0], PLACES[0] - [0.01, 0.0, 0.0]]
    assert tracker.update(moved) == [2, 1]


def test_what_moves_far_or_comes_later_is_another_object() -> None:
    tracker = ObjectTracker(DISTANCE, MEMORY)
    assert tracker.update([PLACES[0]]) == [1]
    assert tracker.update([PLACES[0] + [0.0, 0.06, 0.0]]) == [2]
    assert tracker.update([]) == []
    assert tracker.update([PLACES[3], PLACES[0]]) == [3, 1]
