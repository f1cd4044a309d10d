"""Splines between two states, against their boundary conditions and derivatives."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from kmn_sim.control.interpolation import State, interpolate

value = st.floats(-5.0, 5.0)
states = st.lists(value, min_size=6, max_size=6)
durations = st.floats(0.05, 20.0)


def state(values: list[float], given: int) -> State:
    """Return the state of two joints of which only the first derivatives are given."""
    rows = np.array(values).reshape(3, 2)
    rows[given:] = np.nan
    return State(*rows)


@given(states, states, durations, st.integers(1, 3))
def test_it_starts_and_ends_at_what_is_given(
    a: list[float], b: list[float], duration: float, given: int
) -> None:
    start, end = state(a, given), state(b, given)
    first, last = (interpolate(start, end, duration, t) for t in (0.0, duration))
    for i in range(given):
        scale = 1e-9 * (1.0 + 1.0 / duration**2)
        np.testing.assert_allclose(first[i], start[i], atol=scale)
        np.testing.assert_allclose(last[i], end[i], atol=1e3 * scale)


@given(states, states, durations, st.integers(1, 3), st.floats(0.1, 0.9))
def test_velocity_and_acceleration_are_the_derivatives(
    a: list[float], b: list[float], duration: float, given: int, part: float
) -> None:
    start, end = state(a, given), state(b, given)
    h = 1e-4 * duration
    before, middle, after = (
        interpolate(start, end, duration, part * duration + d) for d in (-h, 0.0, h)
    )
    for i in range(2):
        slope = (after[i] - before[i]) / (2.0 * h)
        tolerance = 1e-5 * (1.0 + np.abs(middle[i + 1]).max() + 50.0 / duration ** (i + 1))
        np.testing.assert_allclose(middle[i + 1], slope, atol=tolerance)


def test_positions_only_are_joined_by_a_line() -> None:
    start, end = state([0.0, 1.0, 0.0, 0.0, 0.0, 0.0], 3), state([2.0, 0.0] + 4 * [0.0], 1)
    middle = interpolate(start, end, 2.0, 0.5)
    np.testing.assert_allclose(middle.positions, [0.5, 0.75])
    np.testing.assert_allclose(middle.velocities, [1.0, -0.5])
