"""Rendering and splatting against the author's depth images and against geometry."""

import json
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kmn_perception.model.camera import Camera
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.model.point_rendering import point_cloud_to_depth
from kmn_perception.model.rendering import depth_to_cloud, depth_to_points, render
from kmn_perception.model.transformation import transform_points

AUTHOR = Path(__file__).parent / "data" / "author_scenes"
SCENES = sorted(json.loads((AUTHOR / "parameters.json").read_text()).items())


def author_scene(name: str, values: list) -> tuple[KinematicModel, np.ndarray, np.ndarray]:
    """Return the model, our rendering and the author's grey values of a scene."""
    model = KinematicModel.load(name[:-2])
    depth = render(model.unit_cubes(*model.split(np.array(values))), model.camera)
    return model, depth, np.asarray(cv2.imread(str(AUTHOR / f"{name}.png"), cv2.IMREAD_UNCHANGED))


@pytest.mark.parametrize(("name", "values"), SCENES)
def test_masks_are_those_of_the_author(name: str, values: list) -> None:
    _, depth, grey = author_scene(name, values)
    assert np.count_nonzero(np.isfinite(depth) != (grey < 255)) <= 4


@pytest.mark.parametrize(("name", "values"), SCENES)
def test_depths_are_those_of_the_author(name: str, values: list) -> None:
    """His 8 bit grey values of the OpenGL depth buffer, within one level."""
    model, depth, grey = author_scene(name, values)
    both = np.isfinite(depth) & (grey < 255)
    near, far = 0.1, 50.0
    buffer = far / (far - near) * (1.0 - near / depth[both])
    least = 0.91 if model.name == "door" else 0.0
    ours = 255.0 * (buffer - least) / (1.0 - least)
    wrong = np.abs(ours - 0.5 - grey[both].astype(float)) > 1.0
    assert np.count_nonzero(wrong) <= 20  # at edges within the image


@given(st.floats(-0.3, 0.3), st.floats(-0.3, 0.3), st.floats(0.5, 3.0))
def test_points_come_back_from_their_projection(x: float, y: float, z: float) -> None:
    """Depth to point is the inverse of the pinhole projection."""
    camera = Camera(64, 48, 50.0, 60.0, 31.5, 23.5, np.eye(4))
    depth = np.full((48, 64), np.nan, dtype=np.float32)
    u, v = round(50.0 * x / z + 31.5), round(60.0 * y / z + 23.5)
    if not (0 <= u < 64 and 0 <= v < 48):
        return
    depth[v, u] = z
    expected = [(u - 31.5) / 50.0 * z, (v - 23.5) / 60.0 * z, z]
    np.testing.assert_allclose(depth_to_points(depth, camera)[v, u], expected, rtol=1e-5)
    np.testing.assert_allclose(depth_to_cloud(depth, camera), [expected], rtol=1e-5)


def test_rendered_points_lie_on_the_box() -> None:
    model = KinematicModel.load("box_b")
    theta = np.array([0.1, -0.15, 0.6])
    cloud = depth_to_cloud(render(model.unit_cubes(theta, []), model.camera), model.camera)
    to_cube = np.linalg.inv(model.unit_cubes(theta, [])[0])
    farthest = np.abs(transform_points(to_cube, cloud)).max(axis=1)
    np.testing.assert_allclose(farthest, 0.5, atol=1e-5)


def test_a_box_behind_the_camera_is_not_seen() -> None:
    model = KinematicModel.load("box_a")
    assert not np.isfinite(render(model.unit_cubes([0.0, -5.0], []), model.camera)).any()


def observed(name: str, values: np.ndarray) -> tuple[KinematicModel, np.ndarray]:
    model = KinematicModel.load(name)
    depth = render(model.unit_cubes(*model.split(values)), model.camera)
    return model, depth_to_cloud(depth, model.camera)


def test_the_depth_image_is_the_block_average_of_the_rendering() -> None:
    """Splatting the cloud of the canonical camera reproduces what that camera saw."""
    model, cloud = observed("door", np.zeros(7))
    image = point_cloud_to_depth(model, cloud, np.eye(4))
    exact = render(model.unit_cubes(np.zeros(3), np.zeros(4)), model.camera)
    value = (model.depth_image.far - exact) / (model.depth_image.far - model.depth_image.near)
    expected = np.nan_to_num(value).reshape(96, 5, 128, 5).mean(axis=(1, 3))
    assert image.shape == (96, 128)
    assert np.abs(image - expected).mean() < 2e-3  # edges, sampled 3 x 3 and 5 x 5 times a pixel
    assert 0.0 <= image.min() < image.max() <= 1.0
    np.testing.assert_array_equal(image[expected == 0.0], 0.0)


def test_morphing_shows_the_prototype() -> None:
    """Equation 5: with the true theta, the morphed cloud looks like the prototype."""
    values = np.array([0.05, -0.05, 0.2])
    model, cloud = observed("box_b", values)
    _, prototype = observed("box_b", np.zeros(3))
    morphed = point_cloud_to_depth(model, cloud, model.transformation.inverse(values))
    expected = point_cloud_to_depth(model, prototype, np.eye(4))
    assert np.count_nonzero((morphed > 0.0) ^ (expected > 0.0)) < 0.15 * np.count_nonzero(expected)


def test_holes_of_a_stretched_cloud_are_closed() -> None:
    """Every third point of a rendered box leaves holes; the depth image has none."""
    model, cloud = observed("box_a", np.zeros(2))
    thinned = cloud[np.random.default_rng(0).uniform(size=len(cloud)) < 0.3]
    full = point_cloud_to_depth(model, cloud, np.eye(4))
    closed = point_cloud_to_depth(model, thinned, np.eye(4))
    inside = cv2.erode((full > 0.3).astype(np.uint8), np.ones((3, 3))) > 0
    np.testing.assert_allclose(closed[inside], full[inside], atol=0.01)


@pytest.mark.parametrize("far_away", [[0.0, 0.0, 1e6], [0.0, -50.0, 0.0], [1e30, 0.0, 0.0]])
def test_points_out_of_view_are_background(far_away: list) -> None:
    model = KinematicModel.load("box_a")
    cloud = np.array([far_away], dtype=np.float32)
    assert not point_cloud_to_depth(model, cloud, np.eye(4)).any()


def test_what_is_too_near_or_too_far_is_not_measured() -> None:
    """A box of 1 m at 0.5 m to 1.5 m from the camera: its front is at 0.5 m, and not its inside."""
    cube = np.eye(4)[None].copy()
    cube[0, 2, 3] = 1.0
    camera = Camera(9, 9, 10.0, 10.0, 4.0, 4.0, np.eye(4), near=0.4, far=5.0)
    np.testing.assert_allclose(render(cube, camera)[4, 4], 0.5)
    assert np.isnan(render(cube, replace(camera, near=0.6))[4, 4])
    assert np.isnan(render(cube, replace(camera, far=0.45))[4, 4])
