"""The support plane: of rendered scenes with a known camera, and of the real Kinect frames."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from kmn_perception.model.camera import Camera, look_at
from kmn_perception.model.rendering import depth_to_points, render
from kmn_perception.scene.settings import SceneSettings
from kmn_perception.scene.support_plane import (
    SupportPlane,
    SupportPlaneSettings,
    find_support_plane,
    pose_above,
)

from .conftest import cuboid

RAISED = SceneSettings.load().raised_plane
SETTINGS = SupportPlaneSettings(0.01, np.radians(75.0), 0.2, RAISED)
CAMERA = Camera.load("kinect_v1").resized(160, 120)
TABLE = cuboid((2.0, 2.0, 0.02), (0.0, 0.0, -0.01))
BOX = cuboid((0.3, 0.2, 0.25), (0.05, -0.1, 0.125))
FLOOR = cuboid((20.0, 20.0, 0.02), (0.0, 0.0, -0.71))
WALL = cuboid((6.0, 0.02, 4.0), (0.0, 1.5, 0.0))


def view(*cuboids: NDArray[np.float64], pose: NDArray[np.float64]) -> NDArray[np.float32]:
    """Return the points that a camera at ``pose`` measures, in its optical frame."""
    camera = Camera(160, 120, CAMERA.fx, CAMERA.fy, CAMERA.cx, CAMERA.cy, pose)
    return depth_to_points(render(np.array(cuboids), camera), camera)


@settings(max_examples=30, deadline=None)
@given(
    height=st.floats(0.4, 1.2),
    pitch=st.floats(25.0, 70.0),
    roll=st.floats(-20.0, 20.0),
    noise=st.floats(0.0, 0.003),
)
def test_height_and_tilt_are_those_of_the_camera(
    height: float, pitch: float, roll: float, noise: float
) -> None:
    canonical = look_at((0.3, -0.8, 0.9), (0.0, 0.0, 0.0))
    heading = np.append(canonical[:2, 2], 0.0)
    target = (
        np.array([0.3, -0.8, height])
        + np.cos(np.radians(pitch)) * heading / np.linalg.norm(heading)
        - np.sin(np.radians(pitch)) * np.array([0.0, 0.0, 1.0])
    )
    pose = look_at((0.3, -0.8, height), target)
    pose[:3, :3] = pose[:3, :3] @ cv2.Rodrigues(np.array([0.0, 0.0, np.radians(roll)]))[0]
    points = view(TABLE, BOX, pose=pose)
    points += np.random.default_rng(1).normal(0.0, noise, points.shape).astype(np.float32)
    plane = find_support_plane(points, SETTINGS)
    assert plane is not None
    np.testing.assert_allclose(pose_above(plane, canonical), pose, atol=5e-4 + noise)


def test_table_before_floor_and_wall_is_the_support() -> None:
    pose = look_at((0.0, -1.0, 0.8), (0.0, 0.0, 0.0))
    plane = find_support_plane(view(TABLE, BOX, FLOOR, WALL, pose=pose), SETTINGS)
    assert plane is not None
    assert plane.height == pytest.approx(0.8, abs=1e-4)


SMALL_TABLE = cuboid((1.2, 0.7, 0.03), (0.0, 0.0, -0.015))
OVER_THE_TABLE = look_at((0.0, -1.3, 0.9), (0.0, -0.6, 0.0))


@pytest.mark.parametrize("noise", [0.0, 0.003])
def test_the_table_is_the_support_though_more_of_the_floor_is_in_view(noise: float) -> None:
    """At a table's edge, with a box on the table and a case on the floor."""
    case = cuboid((0.4, 0.3, 0.3), (0.5, -0.8, -0.55))
    points = view(SMALL_TABLE, BOX, FLOOR, case, pose=OVER_THE_TABLE)
    points += np.random.default_rng(1).normal(0.0, noise, points.shape).astype(np.float32)
    above = points @ OVER_THE_TABLE[:3, :3].T[:, 2] + OVER_THE_TABLE[2, 3]
    on_table, on_floor = (np.abs(above - z) < 0.01 for z in (0.0, -0.7))
    assert on_floor.sum() > 3 * on_table.sum()
    plane = find_support_plane(points, SETTINGS)
    assert plane is not None
    assert plane.height == pytest.approx(0.9, abs=4e-3)


def test_without_anything_on_the_table_the_larger_floor_is_the_support() -> None:
    plane = find_support_plane(view(SMALL_TABLE, FLOOR, pose=OVER_THE_TABLE), SETTINGS)
    assert plane is not None
    assert plane.height == pytest.approx(1.6, abs=1e-3)


def test_the_top_of_a_box_is_no_support_even_with_a_box_upon_it() -> None:
    lower = cuboid((0.6, 0.5, 0.25), (0.0, 0.0, 0.125))
    upper = cuboid((0.2, 0.2, 0.15), (0.0, 0.0, 0.325))
    pose = look_at((0.0, -0.9, 1.0), (0.0, 0.0, 0.1))
    plane = find_support_plane(view(TABLE, lower, upper, pose=pose), SETTINGS)
    assert plane is not None
    assert plane.height == pytest.approx(1.0, abs=1e-3)


def test_a_wall_behind_the_floor_is_no_level_surface() -> None:
    pose = look_at((0.0, -2.5, 0.9), (0.0, 1.5, 0.2))
    case = cuboid((0.5, 0.4, 0.45), (0.3, 0.4, -0.475))
    plane = find_support_plane(view(FLOOR, WALL, case, pose=pose), SETTINGS)
    assert plane is not None
    assert plane.height == pytest.approx(1.6, abs=5e-3)


def test_neither_wall_nor_side_of_a_box_is_a_support() -> None:
    pose = look_at((0.0, -1.0, 0.8), (0.0, 0.0, 0.6))
    assert find_support_plane(view(WALL, pose=pose), SETTINGS) is None


def test_clutter_is_no_support() -> None:
    points = np.random.default_rng(2).uniform((-1, -1, 0.5), (1, 1, 2.5), (5000, 3))
    assert find_support_plane(points.astype(np.float32), SETTINGS) is None


@pytest.mark.parametrize("count", [0, 2])
def test_two_points_make_no_plane(count: int) -> None:
    points = np.full((10, 10, 3), np.nan, dtype=np.float32)
    points.reshape(-1, 3)[:count] = 1.0
    assert find_support_plane(points, SETTINGS) is None


def test_equal_points_make_no_plane() -> None:
    assert find_support_plane(np.ones((100, 3), dtype=np.float32), SETTINGS) is None


def test_same_points_give_the_same_plane() -> None:
    points = view(TABLE, BOX, pose=look_at((0.0, -0.8, 0.7), (0.0, 0.0, 0.0)))
    first, second = (find_support_plane(points, SETTINGS) for _ in range(2))
    assert first is not None and second is not None
    assert np.array_equal(first.normal, second.normal) and first.height == second.height


def test_camera_stands_and_looks_as_the_canonical_one_does() -> None:
    canonical = look_at((-2.5, 0.4, 1.8), (0.0, 1.0, 1.1))
    up = canonical[:3, :3].T @ [0.0, 0.0, 1.0]
    np.testing.assert_allclose(
        pose_above(SupportPlane(up, canonical[2, 3]), canonical), canonical, atol=1e-12
    )


def test_real_table_is_found_within_the_sensor_noise(real_frame: Any) -> None:
    plane = find_support_plane(real_frame.points, SETTINGS)
    assert plane is not None
    heights = real_frame.points[real_frame.labels == 1] @ plane.normal + plane.height
    assert abs(np.nanmean(heights)) < 0.0005
    assert np.nanstd(heights) < 0.0025  # the sensor's own: 0.8 mm at 0.6 m to 2.6 mm at 1.2 m
