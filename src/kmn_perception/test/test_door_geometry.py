"""The geometry of a measured door, against doors built from their corners."""

import numpy as np
import pytest

from kmn_perception.doors.geometry import (
    DOOR,
    MEASURED,
    PROUD,
    View2d,
    door_shape,
    door_values,
    propagate,
)

SQUARE = View2d(0.0, 1.0)  # the camera looks straight at the wall


def line_through(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return (b, c) of the line b x + c y = 1 through two points."""
    return np.linalg.solve(np.stack([a, b]), np.ones(2))


def measured(
    left: np.ndarray, right: np.ndarray, wall: np.ndarray, height: float, grip: np.ndarray
) -> np.ndarray:
    """Return what a camera at the origin measures of a panel between two points.

    ``grip`` is (right, away, up) of the handle's middle against the camera, 5 cm before the panel.
    """
    panel = line_through(left, right)
    middle = 0.5 * (left[0] / left[1] + right[0] / right[1])
    away = 1.0 / (wall @ np.array([middle, 1.0]))
    values = np.zeros(len(MEASURED))
    values[:4] = [*wall, *panel]
    values[4] = 1.0 / height
    values[5:9] = [left[0] / left[1], right[0] / right[1], 1.0, 1.0]
    values[9] = (2.1 - height) / away
    values[10:13] = [grip[0] / grip[1], grip[2] / grip[1], 0.05]
    return values


def handle_before(left: np.ndarray, right: np.ndarray, inset: float) -> np.ndarray:
    """Return the point (2,) 5 cm before the panel, so far from its right edge."""
    along = (right - left) / np.linalg.norm(right - left)
    toward = np.array([along[1], -along[0]])
    return right - inset * along + 0.05 * toward


def test_a_closed_flush_door_seen_squarely_has_its_own_numbers() -> None:
    left, right = np.array([-0.5, 2.0]), np.array([0.4, 2.0])
    wall = line_through(left, right)
    grip = handle_before(left, right, 0.1)
    m = measured(left, right, wall, 1.2, np.array([*grip, 1.05 - 1.2]))
    values = dict(
        zip(DOOR, door_values(m, hinge_right=False, ajar=False, look=SQUARE), strict=True)
    )
    assert values["x"] == pytest.approx(2.0 + 0.019)
    assert values["y"] == pytest.approx(0.05)  # to the left: the door's middle is right of us
    assert values["yaw"] == pytest.approx(0.0, abs=1e-12)
    assert values["door_width"] == pytest.approx(0.9 - 0.8)
    assert values["door_height"] == pytest.approx(0.1)
    assert values["handle_y"] == pytest.approx(0.1 - 0.095)
    assert values["handle_z"] == pytest.approx(1.05 - 1.0 - 0.05)
    assert values["recess"] == pytest.approx(0.0, abs=1e-12)
    assert values["opening"] == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("opening", [-0.3, 0.1, 0.4])
def test_an_open_door_keeps_the_place_that_it_has_when_it_is_closed(opening: float) -> None:
    left, width = np.array([-0.45, 2.2]), 0.85
    right = left + np.array([width, 0.0])
    axis = left + np.array([0.0, 0.019])  # of the hinge, in the panel's middle plane
    turn = np.array([[np.cos(opening), -np.sin(opening)], [np.sin(opening), np.cos(opening)]])
    seen_left, seen_right = (axis + turn @ (corner - axis) for corner in (left, right))
    grip = handle_before(seen_left, seen_right, 0.1)
    wall = line_through(left, right)
    m = measured(seen_left, seen_right, wall, 1.3, np.array([*grip, 1.0 - 1.3]))
    values = dict(zip(DOOR, door_values(m, False, True, SQUARE), strict=True))
    assert values["door_width"] == pytest.approx(width - 0.8)
    assert values["opening"] == pytest.approx(opening)  # away from the camera
    assert values["yaw"] == pytest.approx(0.0, abs=1e-12)
    assert values["y"] == pytest.approx(0.45 - width / 2.0)
    assert values["x"] == pytest.approx(2.2 + 0.019)
    assert values["handle_y"] == pytest.approx(0.1 - 0.095)


@pytest.mark.parametrize("ajar", [False, True])
def test_a_small_turn_of_the_panel_counts_once(ajar: bool) -> None:
    """Whether it counts as open or not: as the angle to its wall, not as the wall's own too."""
    left, opening = np.array([-0.45, 2.0]), 0.028
    right = left + 0.9 * np.array([np.cos(opening), -np.sin(opening)])
    wall = line_through(left, left + np.array([0.9, 0.0]))
    m = measured(left, right, wall, 1.2, np.array([*handle_before(left, right, 0.1), -0.2]))
    values = dict(zip(DOOR, door_values(m, False, ajar, SQUARE), strict=True))
    assert values["yaw"] == pytest.approx(0.0, abs=1e-9)
    assert abs(values["opening"]) == pytest.approx(opening)


def test_the_edge_of_a_frame_hides_the_panels_behind_it() -> None:
    """An edge on the wall belongs to the panel straight behind it, not to the one on its ray."""
    wall, recess = np.array([0.0, 1.0 / 2.0]), 0.1
    m = measured(np.array([0.3, 2.0]), np.array([1.2, 2.0]), wall, 1.0, np.array([1.1, 2.05, 0.0]))
    m[2:4] = [0.0, 1.0 / (2.0 + recess)]
    m[7:9] = 0.0
    shape = door_shape(m, hinge_right=False, ajar=False)
    np.testing.assert_allclose(shape.left, [0.3, 2.1])
    np.testing.assert_allclose(shape.right, [1.2, 2.1])
    assert shape.recess == pytest.approx(recess)


def test_the_frame_tells_how_wide_an_open_panel_is() -> None:
    """The swung edge is as far from the hinge as the frame's edges are apart."""
    width, opening, wall = 0.9, 0.4, np.array([0.0, 1.0 / 2.0])
    hinge = np.array([-0.4, 2.0])
    swung = hinge + width * np.array([np.cos(opening), np.sin(opening)])
    m = measured(hinge, swung, wall, 1.2, np.array([0.4, 2.3, 0.0]))
    m[6], m[8] = (hinge[0] + width) / 2.0, 0.0  # the right line is the frame's edge
    shape = door_shape(m, hinge_right=False, ajar=True)
    np.testing.assert_allclose(shape.right, swung)
    np.testing.assert_allclose(shape.left, hinge)


def test_a_frame_that_stands_out_is_nearer_than_its_wall() -> None:
    proud, recess, wall = 0.03, 0.1, np.array([0.0, 1.0 / 2.0])
    m = measured(np.array([0.3, 2.0]), np.array([1.2, 2.0]), wall, 1.0, np.array([1.1, 2.05, 0.0]))
    m[2:4] = [0.0, 1.0 / (2.0 + recess)]
    m[5:9] = [0.3 / (2.0 - proud), 1.2 / (2.0 - proud), 0.0, 0.0]
    m[PROUD] = proud
    shape = door_shape(m, hinge_right=False, ajar=False)
    np.testing.assert_allclose(shape.left, [0.3, 2.1])
    np.testing.assert_allclose(shape.right, [1.2, 2.1])


def test_a_handle_at_the_left_is_the_mirror_image() -> None:
    left, right = np.array([-0.7, 1.9]), np.array([0.2, 2.1])
    wall = line_through(left, right)
    grip = handle_before(left, right, 0.09)
    m = measured(left, right, wall, 1.2, np.array([*grip, -0.2]))
    mirrored = m.copy()
    mirrored[[0, 2, 10]] *= -1.0
    mirrored[5], mirrored[6] = -m[6], -m[5]
    a = dict(zip(DOOR, door_values(m, False, False, SQUARE), strict=True))
    b = dict(zip(DOOR, door_values(mirrored, True, False, SQUARE), strict=True))
    for name in ("x", "door_width", "door_height", "handle_y", "handle_z"):
        assert a[name] == pytest.approx(b[name])
    for name in ("y", "yaw"):
        assert a[name] == pytest.approx(-b[name])


def test_covariances_follow_a_linear_function() -> None:
    matrix = np.array([[1.0, 2.0, 0.0], [0.5, -1.0, 3.0]])
    covariance = np.diag([0.1, 0.2, 0.3]) + 0.02
    value, found = propagate(lambda m: m @ matrix.T, np.array([1.0, 2.0, 3.0]), covariance)
    np.testing.assert_allclose(value, matrix @ [1.0, 2.0, 3.0])
    np.testing.assert_allclose(found, matrix @ covariance @ matrix.T, rtol=1e-6)
