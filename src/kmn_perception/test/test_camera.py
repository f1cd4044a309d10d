"""Cameras: the author's poses, and resizing that keeps the view."""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml

from kmn_perception.configuration import resources
from kmn_perception.configuration.section import ConfigurationError
from kmn_perception.model.camera import Camera, look_at


def test_door_camera_stands_where_the_author_put_it() -> None:
    """His pose has OpenGL axes: y up and z backwards instead of y down and z forward."""
    pose = Camera.load("door").pose
    np.testing.assert_allclose(pose[:3, 0], [0.0, -1.0, 0.0], atol=1e-9)
    np.testing.assert_allclose(-pose[:3, 1], [0.26963, 0.0, 0.962964], atol=1e-6)
    np.testing.assert_allclose(-pose[:3, 2], [-0.962964, 0.0, 0.26963], atol=1e-6)
    np.testing.assert_allclose(pose[:3, 3], [-2.5, 0.0, 1.8])


def test_field_of_view_is_45_degrees() -> None:
    camera = Camera.load("box")
    assert 2.0 * np.degrees(np.arctan(camera.height / 2.0 / camera.fy)) == pytest.approx(45.0)


def test_a_pose_is_a_rotation_that_faces_its_target() -> None:
    pose = look_at([1.0, 2.0, 3.0], [0.0, 0.5, -1.0])
    np.testing.assert_allclose(pose[:3, :3] @ pose[:3, :3].T, np.eye(3), atol=1e-12)
    assert np.linalg.det(pose[:3, :3]) == pytest.approx(1.0)
    target = np.linalg.inv(pose) @ [0.0, 0.5, -1.0, 1.0]
    np.testing.assert_allclose(target[:2], 0.0, atol=1e-12)
    assert target[2] > 0.0


def test_resizing_keeps_the_corners_of_the_view() -> None:
    camera = Camera.load("kinect_v1")
    small = camera.resized(128, 96)
    for corner in (-0.5, 1.0):
        edge = camera.width * corner - 0.5 if corner > 0 else -0.5
        small_edge = small.width * corner - 0.5 if corner > 0 else -0.5
        assert (edge - camera.cx) / camera.fx == pytest.approx((small_edge - small.cx) / small.fx)


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("fx", 0.0, "'fx' must be a number in"),
        ("width", 640.5, "'width' must be a whole number"),
        ("far", 0.01, "'far' must be a number in"),
        ("pose", {"position": [0, 0, 1]}, "pose: key 'look_at' is missing"),
    ],
)
def test_wrong_files_are_refused(tmp_path: Path, key: str, value: object, message: str) -> None:
    content = yaml.safe_load(resources.find("config/cameras", "door").read_text())
    content[key] = value
    file = tmp_path / "mine.yaml"
    file.write_text(yaml.safe_dump(content))
    with pytest.raises(ConfigurationError, match=message):
        Camera.load(file)


def test_points_are_projected_as_opencv_does() -> None:
    rng = np.random.default_rng(0)
    camera = replace(Camera.load("door"), fy=400.0, cx=300.5)
    points = rng.uniform(-1.0, 1.0, (5, 7, 3))
    to_camera = camera.world_to_camera
    rotation, _ = cv2.Rodrigues(to_camera[:3, :3])
    expected, _ = cv2.projectPoints(
        points.reshape(-1, 3), rotation, to_camera[:3, 3], camera.matrix, np.zeros(4)
    )
    pixels = camera.project(points)
    np.testing.assert_allclose(pixels[..., :2].reshape(-1, 2), expected[:, 0], atol=1e-9)
    seen = points @ to_camera[:3, :3].T + to_camera[:3, 3]
    np.testing.assert_allclose(pixels[..., 2], seen[..., 2], atol=1e-12)
    rays = camera.rays(pixels[..., 0], pixels[..., 1])
    np.testing.assert_allclose(rays * pixels[..., 2:], seen, atol=1e-12)
