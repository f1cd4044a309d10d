"""The sensor diagnosis on real frames, as they are and broken in each of the ways it knows."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from kmn_perception.bags.example_bag import load_frames
from kmn_perception.model.camera import Camera
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.model.rendering import depth_to_points, render
from kmn_perception.model.sensor_noise import add_noise
from kmn_perception.scene.sensor_diagnosis import Description, DiagnosisSettings, diagnose
from kmn_perception.scene.settings import SceneSettings

KINECT = Camera.load("kinect_v1")
SETTINGS = DiagnosisSettings.load()
INTRINSICS = SceneSettings.load().intrinsics
FRAMES = load_frames()
DESCRIBED = Description(KINECT, "camera_depth_optical_frame", "camera_depth_optical_frame")


def _keys(points: NDArray[np.float32], described: Description = DESCRIBED) -> list[str]:
    found = diagnose(points.astype(np.float32), described, SETTINGS, INTRINSICS)
    assert all(len(diagnosis.text) > 40 for diagnosis in found)
    return [diagnosis.key for diagnosis in found]


@pytest.fixture(params=range(len(FRAMES)))
def depth(request: pytest.FixtureRequest) -> NDArray[np.float32]:
    return FRAMES[request.param]


@pytest.fixture
def points(depth: NDArray[np.float32]) -> NDArray[np.float32]:
    return depth_to_points(depth, KINECT)


def test_a_good_frame_gives_no_alarm(points: NDArray[np.float32]) -> None:
    assert not _keys(points)
    assert not _keys(points, Description())
    assert not _keys(points.reshape(-1, 3))
    assert not _keys(points[::2, ::2])
    assert not _keys(np.full_like(points, np.nan))


@pytest.mark.parametrize("name", ["box", "box_c", "door"])
@pytest.mark.parametrize("noise", ["none", "mm", "kinect"])
def test_simulated_scenes_give_no_alarm(name: str, noise: str) -> None:
    model, generator = KinematicModel.load(name), np.random.default_rng(0)
    for values in model.sample(generator, 5):
        exact = render(model.unit_cubes(*model.split(values)), model.camera)
        seen = depth_to_points(add_noise(exact, noise, generator), model.camera)
        assert not _keys(seen, Description(model.camera))


def test_millimetres_taken_for_metres_are_recognised(points: NDArray[np.float32]) -> None:
    assert _keys(1000.0 * points) == ["millimetres_as_metres"]
    assert _keys(1000.0 * points.reshape(-1, 3)) == ["millimetres_as_metres"]


def test_metres_taken_for_millimetres_are_recognised(points: NDArray[np.float32]) -> None:
    assert _keys(points / 1000.0) == ["metres_as_millimetres"]


def test_intrinsics_of_another_resolution_are_recognised(depth: NDArray[np.float32]) -> None:
    half = depth[::2, ::2]
    large = replace(KINECT, width=320, height=240)  # as for 640 x 480
    assert _keys(depth_to_points(half, large), Description(large)) == ["other_resolution"]
    small = replace(KINECT.resized(320, 240), width=640, height=480)
    (found,) = diagnose(depth_to_points(depth, small), Description(small), SETTINGS, INTRINSICS)
    assert found.key == "other_resolution"
    assert "in that of one of 320 x 240" in found.text


def test_a_cloud_made_with_another_focal_length_is_recognised(points: NDArray[np.float32]) -> None:
    other = replace(KINECT, fx=575.8, fy=575.8)
    assert _keys(points, DESCRIBED._replace(camera=other)) == ["other_intrinsics"]


@pytest.mark.parametrize(
    ("key", "axes"),
    [
        ("body_frame", [[0, 0, 1], [-1, 0, 0], [0, -1, 0]]),
        ("flipped_z", [[1, 0, 0], [0, 1, 0], [0, 0, -1]]),
        ("graphics_frame", [[1, 0, 0], [0, -1, 0], [0, 0, -1]]),
    ],
)
def test_other_axes_are_recognised(
    key: str, axes: list[list[int]], points: NDArray[np.float32]
) -> None:
    broken = points @ np.array(axes, dtype=np.float32).T
    assert _keys(broken) == [key]
    if key != "graphics_frame":  # which rows and columns alone tell from the other
        assert _keys(broken.reshape(-1, 3)) == [key]


def _align(depth: NDArray[np.float32], focal: float, baseline: float) -> NDArray[np.float32]:
    """Map a depth image to the pixels of a camera beside, as drivers do for a colour camera."""
    seen = depth_to_points(depth, KINECT).reshape(-1, 3)
    x, y, z = seen[np.isfinite(seen[:, 2])].T
    u = np.rint((x + baseline) / z * focal + KINECT.cx).astype(int)
    v = np.rint(y / z * focal + KINECT.cy).astype(int)
    inside = (u >= 0) & (v >= 0) & (u < KINECT.width) & (v < KINECT.height)
    aligned = np.full(depth.shape, np.inf, dtype=np.float32)
    np.minimum.at(aligned, (v[inside], u[inside]), z[inside])
    aligned[np.isinf(aligned)] = np.nan
    return aligned


@pytest.mark.parametrize("focal", [510.0, 525.0, 540.0, 575.0])
def test_depth_aligned_to_another_camera_is_recognised(
    focal: float, depth: NDArray[np.float32]
) -> None:
    seen = depth_to_points(_align(depth, focal, baseline=0.025), KINECT)
    assert _keys(seen) == ["aligned_to_other_camera"]
    colour = DESCRIBED._replace(frame="camera_rgb_frame", camera_frame="camera_rgb_frame")
    assert not _keys(seen, colour)


def test_frames_that_differ_are_told(points: NDArray[np.float32]) -> None:
    described = DESCRIBED._replace(frame="camera_rgb_optical_frame")
    assert _keys(points, described) == ["aligned_to_other_camera"]


def test_a_cloud_in_the_frame_of_another_camera_is_recognised(points: NDArray[np.float32]) -> None:
    assert _keys(points + np.array([0.025, 0.0, 0.0], dtype=np.float32)) == ["other_origin"]
