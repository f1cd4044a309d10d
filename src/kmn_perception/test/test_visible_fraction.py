"""The visible fraction of a plate that faces the camera, counted by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from kmn_perception.evaluation.visible_fraction import visible_fraction
from kmn_perception.model.camera import Camera
from kmn_perception.model.kinematic_model import KinematicModel

# At a distance of 1 m a pixel is 1 cm; the image reaches from -0.5 to 0.5 m, its border is
# half a pixel beyond the outermost pixel centres.
CAMERA = Camera(101, 101, 100.0, 100.0, 50.0, 50.0, np.eye(4), near=0.1, far=50.0)


def plate(x: float, y: float, width: float, height: float) -> NDArray[np.float64]:
    """Return a thin unit cube whose front is 1 m before the camera; metres."""
    cube = np.diag([width, height, 1e-6, 1.0])
    cube[:3, 3] = x, y, 1.0
    return cube[None]


@pytest.mark.parametrize(
    ("x", "y", "expected"),
    [
        (0.0, 0.0, 1.0),  # wholly in view
        (0.505, 0.0, 0.5),  # half of it right of the border
        (0.505, -0.505, 0.25),  # only the corner is left
        (0.0, 0.555, 0.25),
        (3.0, 0.0, 0.0),  # wholly out of view
    ],
)
def test_the_share_of_a_plate_in_the_image(x: float, y: float, expected: float) -> None:
    fraction = visible_fraction(plate(x, y, 0.2001, 0.2001), CAMERA)
    assert fraction == pytest.approx(expected, abs=0.03)
    assert (fraction == 1.0) == (expected == 1.0)


def test_one_pixel_out_of_view_counts() -> None:
    """60 pixels wide, centres from -9 to 50: moved on by one, one column of 60 is lost."""
    assert visible_fraction(plate(0.205, 0.0, 0.5999, 0.1), CAMERA) == 1.0
    assert visible_fraction(plate(0.215, 0.0, 0.5999, 0.1), CAMERA) == pytest.approx(59 / 60)


def test_what_reaches_behind_the_camera_is_partly_visible() -> None:
    cube = np.diag([0.2, 0.2, 4.0, 1.0])
    cube[0, 3] = 0.15  # beside the camera
    assert 0.0 < visible_fraction(cube[None], CAMERA) < 1.0


def test_a_door_seen_by_a_lower_camera_loses_its_top() -> None:
    """Of 2 m seen from 2.5 m as a plane, the part above the image's upper border is lost."""
    door = KinematicModel.load("door")
    pose = np.array(
        [[0.0, 0.0, 1.0, -2.5], [-1.0, 0.0, 0.0, 0.0], [0.0, -1.0, 0.0, 0.5], [0.0, 0.0, 0.0, 1.0]]
    )
    camera = replace(door.camera, pose=pose)
    distance = 2.5 - 0.019  # to the front
    top = 0.5 + distance * (camera.cy + 0.5) / camera.fy
    fraction = visible_fraction(door.unit_cubes(np.zeros(3), np.zeros(4)), camera)
    assert fraction == pytest.approx(top / 2.0, abs=0.01)
