"""Errors of estimated doors and their deviations, against values computed by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from kmn_perception.doors.door_estimate import DoorEstimate
from kmn_perception.doors.geometry import MEASURED, View2d, door_shape, door_values
from kmn_perception.evaluation.doors.errors import UNITS, DoorErrors, door_place, errors
from kmn_perception.evaluation.doors.label import DoorLabel, Known

from .door_example import (
    FRONT,
    HANDLE,
    HEIGHT,
    LABEL,
    MODEL,
    POSE,
    SETTINGS,
    TRUTH,
    WIDTH,
    estimate_of,
)


def _compare(estimate: DoorEstimate, label: DoorLabel = LABEL) -> DoorErrors:
    return errors(estimate, label, MODEL, SETTINGS)


def _named(values: NDArray[np.float64]) -> dict[str, float]:
    return dict(zip(UNITS, values.tolist(), strict=True))


def test_a_perfect_estimate_has_no_errors() -> None:
    values = _named(_compare(estimate_of()).values)
    assert np.isnan(values.pop("opening"))  # both are closed
    np.testing.assert_allclose(list(values.values()), 0.0, atol=1e-9)


def test_errors_are_estimate_minus_label_along_the_labels_axes() -> None:
    # 10 mm farther, 4 mm to the left, 20 mm wider, 30 mm higher; the handle 7 mm to the left of
    # where it would be then, and 5 mm lower.
    moved = estimate_of(
        x=TRUTH["x"] + 0.01, y=0.004, door_width=0.12, door_height=0.13, handle_y=-0.003,
        handle_z=-0.02,
    )  # fmt: skip
    values = _named(_compare(moved).values)
    values.pop("opening")
    expected = {
        "left": -14.0, "right": 6.0, "distance": -10.0, "yaw": 0.0, "width": 20.0, "top": 30.0,
        "handle_up": -5.0, "handle_along": -4.0 + 10.0 - 7.0,
    }  # fmt: skip
    assert values == pytest.approx(expected, abs=1e-6)


def test_a_turned_panel_has_its_yaw_and_its_edges_off() -> None:
    yaw = np.radians(2.0)  # to the left, about the panel's middle
    values = _named(_compare(estimate_of(yaw=yaw)).values)
    c, s = np.cos(yaw), np.sin(yaw)
    assert values["yaw"] == pytest.approx(2.0, abs=1e-9)
    assert values["left"] == pytest.approx(1e3 * (WIDTH / 2 * (1 - c) + FRONT * s), abs=1e-6)
    assert values["right"] == pytest.approx(1e3 * (WIDTH / 2 * (c - 1) + FRONT * s), abs=1e-6)
    assert values["width"] == pytest.approx(0.0, abs=1e-9)


def test_deviations_follow_from_the_covariance_and_join_those_of_the_label() -> None:
    deviations = {"x": 0.003, "y": 0.004, "door_width": 0.006, "door_height": 0.02}
    found = _compare(estimate_of(deviations))
    stated, combined = _named(found.stated), _named(found.deviations)
    # Half of the width's deviation moves an edge: 3, 4, 5. Half of the height's moves the handle.
    assert (stated["left"], stated["right"]) == pytest.approx((5.0, 5.0), abs=1e-6)
    assert (stated["distance"], stated["top"]) == pytest.approx((3.0, 20.0), abs=1e-6)
    assert stated["handle_up"] == pytest.approx(10.0, abs=1e-6)
    assert combined["left"] == pytest.approx(13.0, abs=1e-6)
    assert combined["right"] == pytest.approx(5.0, abs=1e-6)
    assert combined["distance"] == pytest.approx(5.0, abs=1e-6)
    assert combined["width"] == pytest.approx(10.0, abs=1e-6)
    assert combined["yaw"] == pytest.approx(0.1, abs=1e-6)


@pytest.mark.parametrize(
    ("estimate", "is_wrong"),
    [
        (estimate_of({"y": 0.1}, y=0.029), False),
        (estimate_of({"y": 0.1}, y=0.031), True),
        (estimate_of({"yaw": 0.1}, yaw=np.radians(2.9)), False),
        (estimate_of({"yaw": 0.1}, yaw=np.radians(3.1)), True),
        (estimate_of({"door_height": 0.01}, door_height=0.1 + 0.029), False),
        (estimate_of({"door_height": 0.01}, door_height=0.1 + 0.031), True),
    ],
)
def test_wrong_is_what_breaks_a_limit_or_a_promise(estimate: DoorEstimate, is_wrong: bool) -> None:
    label = LABEL._replace(handle=None)
    assert _compare(estimate, label).is_wrong(SETTINGS) == is_wrong


def test_a_handle_at_the_other_edge_is_wrong() -> None:
    mirrored = replace(
        estimate_of({"y": 0.005, "handle_y": 0.01}), handle_side="left", latch_side="left"
    )
    found = _compare(mirrored)
    assert _named(found.values)["handle_along"] == pytest.approx(-1e3 * 2 * HANDLE[0], abs=1e-6)
    assert found.is_wrong(SETTINGS)


def test_an_open_door_that_is_taken_for_closed_is_wrong() -> None:
    found = _compare(estimate_of(), LABEL._replace(opening=Known(4.0, 0.3), handle=None))
    assert _named(found.values)["opening"] == pytest.approx(-4.0)
    assert _named(found.deviations)["opening"] == pytest.approx(SETTINGS.opening_deviation)
    assert found.is_wrong(SETTINGS)


def test_what_a_label_or_an_estimate_does_not_know_is_not_compared() -> None:
    label = LABEL._replace(top=None, edges=(None, LABEL.edges[1]))
    values = _named(_compare(replace(estimate_of(), handle_side=""), label).values)
    unknown = {name for name, value in values.items() if np.isnan(value)}
    assert unknown == {"left", "top", "handle_up", "handle_along", "opening"}


@pytest.mark.parametrize("side", ["left", "right"])
@pytest.mark.parametrize("turn", [0.0, 0.08, -0.08])
def test_the_place_of_a_door_is_where_its_parameters_were_measured(side: str, turn: float) -> None:
    """Through the finder's geometry, which goes the other way."""
    left, right, top = np.array([-0.3, 1.9]), np.array([0.6, 1.9]), 2.1
    hinge, latch = (right, left) if side == "left" else (left, right)
    c, s = np.cos(turn), np.sin(turn)
    axis = np.array([s, c])  # the panel's normal, away from the camera
    along = np.array([c, -s]) * (1.0 if side == "right" else -1.0)
    latch = hinge + 0.9 * along
    corners = (latch, hinge) if side == "left" else (hinge, latch)
    middle, handle = 0.5 * (corners[0] + corners[1]), latch - 0.1 * along
    m = np.zeros(len(MEASURED))
    m[0:2], m[2:4] = np.array([0.0, 1.0]) / 1.9, axis / (axis @ hinge)
    m[4] = 1.0 / HEIGHT
    m[5:7] = [p[0] / p[1] for p in corners]
    m[7:9] = 1.0
    wall_away = 1.9
    m[9] = (top - HEIGHT) / wall_away
    grip = handle - 0.051 * axis
    m[10], m[11], m[12] = grip[0] / grip[1], (1.0 - HEIGHT) / grip[1], 0.051
    ajar = turn != 0.0
    shape = door_shape(m, side == "left", ajar)
    np.testing.assert_allclose([shape.left, shape.right], corners, atol=1e-9)
    values = door_values(m, side == "left", ajar, View2d(0.0, 1.0))
    place = door_place(values, side, POSE, MODEL)
    assert middle[1] > 0.0
    # The model's hinge is inside the panel, the finder's at its front: 2 mm at 0.08 rad.
    np.testing.assert_allclose(place.left[1][[0, 2]], corners[0], atol=2e-3)
    np.testing.assert_allclose(place.right[1][[0, 2]], corners[1], atol=2e-3)
    np.testing.assert_allclose(place.handle[[0, 2]], grip, atol=2e-3)
    np.testing.assert_allclose(place.handle[1], HEIGHT - 1.0, atol=1e-9)
    np.testing.assert_allclose(place.normal, [-axis[0], 0.0, -axis[1]], atol=1e-9)
    assert place.top == pytest.approx(top)
