"""A camera of which nothing is known: a level surface above it is a ceiling, or the floor."""

from dataclasses import replace

import numpy as np
import pytest

from kmn_perception.doors.camera_check import doubt_upright
from kmn_perception.doors.door_estimate import DoorEstimate
from kmn_perception.doors.planes import Plane
from kmn_perception.doors.settings import DoorSettings

SETTINGS = DoorSettings.load()
UP = np.array([0.0, -1.0, 0.0])
TOP = 0.8  # of the door above the camera, metres
UPPER, LOWER = TOP * UP, -1.2 * UP


def door(top_is_seen: bool, handle_side: str = "") -> DoorEstimate:
    corners = np.array([UPPER, UPPER, LOWER, LOWER]) + [0.0, 0.0, 2.0]
    estimate = DoorEstimate.none("")
    return replace(estimate, corners=corners, top_is_seen=top_is_seen, handle_side=handle_side)


def doubt(distance: float, top_is_seen: bool = True, handle_side: str = "") -> str:
    above = Plane(UP / distance, 500)
    return doubt_upright(door(top_is_seen, handle_side), [above], UP, SETTINGS)


@pytest.mark.parametrize("distance", [TOP + 0.3, TOP + 1.2, SETTINGS.floor.heights[1] + 0.2])
def test_a_surface_above_a_top_that_is_seen_is_a_ceiling(distance: float) -> None:
    assert doubt(distance) == ""


@pytest.mark.parametrize("distance", [TOP - 0.1, TOP, TOP + 0.1])
def test_a_surface_at_the_top_may_be_the_floor(distance: float) -> None:
    assert "upside down" in doubt(distance)


def test_where_the_top_is_not_known_so_may_any_surface() -> None:
    assert "upside down" in doubt(TOP + 1.0, top_is_seen=False)
    assert doubt(TOP + 1.0, top_is_seen=False, handle_side="left") == ""


def test_a_surface_farther_than_any_camera_is_from_its_floor_is_a_ceiling() -> None:
    assert doubt(SETTINGS.floor.heights[1] + 0.2, top_is_seen=False) == ""
