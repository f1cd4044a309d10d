"""Overlap and differences of upright boxes, against counting points."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from kmn_perception.experiments.upright_box import (
    UprightBox,
    box_of_cube,
    errors,
    intersection_over_union,
)

LENGTHS = st.floats(0.05, 0.4)
SHIFTS = st.floats(-0.15, 0.15)
YAWS = st.floats(-3.0, 3.0)
BOXES = st.builds(
    lambda x, y, z, a, b, c, yaw: UprightBox(np.array([x, y, z]), np.array([a, b, c]), yaw),
    SHIFTS, SHIFTS, SHIFTS, LENGTHS, LENGTHS, LENGTHS, YAWS,
)  # fmt: skip


def _inside(box: UprightBox, points: NDArray[np.float64]) -> NDArray[np.bool_]:
    own = np.linalg.inv(box.unit_cube)
    local = points @ own[:3, :3].T + own[:3, 3]
    return np.asarray((np.abs(local) <= 0.5).all(axis=1))


@given(BOXES, BOXES)
def test_overlap_is_that_of_points_drawn_at_random(a: UprightBox, b: UprightBox) -> None:
    points = np.random.default_rng(0).uniform(-0.5, 0.5, size=(40_000, 3))
    in_a, in_b = _inside(a, points), _inside(b, points)
    if (either := (in_a | in_b).sum()) > 100:
        counted = (in_a & in_b).sum() / either
        deviation = np.sqrt(counted * (1.0 - counted) / either)
        assert intersection_over_union(a, b) == pytest.approx(counted, abs=0.02 + 5.0 * deviation)


@given(BOXES, st.integers(-3, 3))
def test_a_box_is_the_same_with_its_axes_turned_by_quarters(box: UprightBox, turns: int) -> None:
    turned = box.turned(turns)
    assert intersection_over_union(box, turned) == pytest.approx(1.0, abs=1e-9)
    off = errors(turned, box)
    assert off.yaw == pytest.approx(0.0, abs=1e-9)
    np.testing.assert_allclose(off.size, 0.0, atol=1e-12)


@given(BOXES)
def test_a_box_is_read_back_from_its_unit_cube(box: UprightBox) -> None:
    assert intersection_over_union(box, box_of_cube(box.unit_cube)) == pytest.approx(1.0, abs=1e-9)


def test_errors_are_those_along_the_axes_of_the_reference() -> None:
    reference = UprightBox(np.array([0.1, 0.2, 0.1]), np.array([0.3, 0.1, 0.2]), 0.2)
    box = UprightBox(np.array([0.1, 0.203, 0.104]), np.array([0.11, 0.28, 0.2]), 0.25 + np.pi / 2)
    off = errors(box, reference)
    assert off.yaw == pytest.approx(0.05)
    np.testing.assert_allclose(off.size, [0.02, 0.01, 0.0], atol=1e-12)
    assert off.centre == pytest.approx(0.005)
