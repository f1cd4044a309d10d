"""Intrinsics from the points of an organised cloud."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kmn_perception.model.camera import Camera
from kmn_perception.model.rendering import depth_to_cloud, depth_to_points
from kmn_perception.scene.intrinsics import camera_as_dense, camera_of_points
from kmn_perception.scene.settings import SceneSettings

from .conftest import RealFrame

SETTINGS = SceneSettings.load().intrinsics


@given(
    st.floats(100.0, 1000.0), st.floats(100.0, 1000.0), st.floats(-20.0, 120.0),
    st.floats(-20.0, 120.0), st.integers(0, 2**31),
)  # fmt: skip
def test_the_camera_of_a_cloud_is_found(
    fx: float, fy: float, cx: float, cy: float, seed: int
) -> None:
    generator = np.random.default_rng(seed)
    camera = Camera(160, 120, fx, fy, cx, cy, np.eye(4))
    depth = generator.uniform(0.5, 3.0, (120, 160)).astype(np.float32)
    depth[generator.uniform(size=depth.shape) < 0.3] = np.nan
    found = camera_of_points(depth_to_points(depth, camera), np.eye(4), SETTINGS)
    assert found is not None
    assert (found.width, found.height) == (160, 120)
    np.testing.assert_allclose(
        [found.fx, found.fy, found.cx, found.cy], [fx, fy, cx, cy], rtol=1e-3, atol=0.05
    )


def test_a_real_frame_shows_its_camera(real_frame: RealFrame) -> None:
    found = camera_of_points(real_frame.points, np.eye(4), SETTINGS)
    assert found is not None
    assert found.fx == pytest.approx(525.0, abs=0.1)
    assert found.cy == pytest.approx(239.5, abs=0.1)


@pytest.mark.parametrize("kind", ["nothing", "no pinhole", "one column"])
def test_what_is_not_from_a_pinhole_has_no_camera(kind: str) -> None:
    points = np.random.default_rng(0).uniform(0.5, 1.0, (48, 64, 3)).astype(np.float32)
    if kind == "nothing":
        points[:] = np.nan
    if kind == "one column":
        points[..., 0] = 0.0
    assert camera_of_points(points, np.eye(4), SETTINGS) is None


@pytest.mark.parametrize("coarser", [1, 2, 4, 8])
def test_a_cloud_without_rows_gets_as_many_pixels_as_it_can_fill(coarser: int) -> None:
    """A wall that a coarser camera sees from the same place."""
    camera = Camera.load("door")
    taken = camera.resized(camera.width // coarser, camera.height // coarser)
    depth = np.full((taken.height, taken.width), 2.0, dtype=np.float32)
    found = camera_as_dense(depth_to_cloud(depth, taken), camera, SETTINGS)
    assert found.width == pytest.approx(taken.width, rel=0.35)
    assert found.width <= taken.width + 1
    assert found.fx / found.width == pytest.approx(camera.fx / camera.width)
