"""Rectified depth images: against rays that OpenCV distorts, and against the models' formulas."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from std_msgs.msg import Header

from kmn_perception.model.camera import Camera
from kmn_perception.model.distortion import Distortion, rectify, resample
from kmn_perception.model.rendering import depth_to_points
from kmn_perception.ros.messages import (
    MessageError,
    image_from_depth,
    info_from_camera,
    view_from_image,
)

CAMERA = replace(Camera.load("kinect_v1").resized(320, 240), cx=155.0, cy=122.5)
RADIAL = {
    "plumb_bob": (0.1, -0.05, 0.001, -0.002, 0.01),
    "rational_polynomial": (0.3, -0.1, 0.001, -0.002, 0.01, 0.2, -0.05, 0.005),
    "equidistant": (-0.02, 0.005, 0.001, -0.0005),
}


def distorted(x: NDArray, y: NDArray, model: str) -> tuple[NDArray, NDArray]:
    """Return where rays (x, y, 1) meet the raw image, by the formulas of the models."""
    r = np.hypot(x, y)
    if model == "equidistant":
        k1, k2, k3, k4 = RADIAL[model]
        angle = np.arctan(r)
        stretched = angle * (1 + k1 * angle**2 + k2 * angle**4 + k3 * angle**6 + k4 * angle**8)
        scale = np.divide(stretched, r, out=np.ones_like(r), where=r > 0)
        return x * scale, y * scale
    k1, k2, p1, p2, k3, *rest = RADIAL[model]
    k4, k5, k6 = rest or (0.0, 0.0, 0.0)
    scale = (1 + k1 * r**2 + k2 * r**4 + k3 * r**6) / (1 + k4 * r**2 + k5 * r**4 + k6 * r**6)
    return (
        x * scale + 2 * p1 * x * y + p2 * (r**2 + 2 * x**2),
        y * scale + p1 * (r**2 + 2 * y**2) + 2 * p2 * x * y,
    )


def raw_depth(model: str, plane: NDArray) -> NDArray[np.float32]:
    """Return the raw image of a plane ``plane . p = 1``, found by undistorting every pixel."""
    v, u = np.indices((CAMERA.height, CAMERA.width))
    wanted = CAMERA.rays(u, v)
    x, y = wanted[..., 0].copy(), wanted[..., 1].copy()
    for _ in range(50):  # fixed point: the distortion is small
        found = distorted(x, y, model)
        x += wanted[..., 0] - found[0]
        y += wanted[..., 1] - found[1]
    return (1.0 / np.stack([x, y, np.ones_like(x)], axis=-1).dot(plane)).astype(np.float32)


PLANE = np.array([0.15, -0.25, 0.8])


@pytest.mark.parametrize("model", list(RADIAL))
def test_a_rectified_plane_is_a_plane(model: str) -> None:
    raw = raw_depth(model, PLANE)
    rectified = rectify(raw, Distortion(model, RADIAL[model], CAMERA), CAMERA)
    seen = np.isfinite(rectified)
    assert seen.mean() > 0.9
    # Depths of the nearest raw pixel: as exact as half a pixel's step in depth.
    error = np.abs(depth_to_points(rectified, CAMERA)[seen] @ PLANE - 1.0)
    straight = np.abs(depth_to_points(raw, CAMERA)[seen] @ PLANE - 1.0)
    assert error.max() < 2e-3
    assert straight.max() > 4.0 * error.max()


@pytest.mark.parametrize("model", list(RADIAL))
def test_a_depth_image_with_a_distorted_description_is_rectified(model: str) -> None:
    raw = raw_depth(model, PLANE)
    info = info_from_camera(CAMERA, Header())
    info.distortion_model, info.d = model, list(RADIAL[model])
    image = image_from_depth(raw, "32FC1", Header())
    rectified, as_it_is = (view_from_image(image, info, 100.0, on).points for on in (True, False))
    errors = [np.nanmax(np.abs(points @ PLANE - 1.0)) for points in (rectified, as_it_is)]
    assert errors[0] < 2e-3 < 5e-3 < errors[1]


@pytest.mark.parametrize(
    ("model", "coefficients", "text"),
    [
        ("thin_prism", [0.1] * 4, "model 'thin_prism' is not known, expected plumb_bob, rational"),
        ("plumb_bob", [0.1] * 3, "'plumb_bob' has coefficients .*, expected 4 or 5 finite numbers"),
        ("equidistant", [float("nan")] * 4, "expected 4 finite numbers"),
    ],
)
def test_an_unknown_distortion_is_refused_with_the_remedy(
    model: str, coefficients: list[float], text: str
) -> None:
    info = info_from_camera(CAMERA, Header())
    info.distortion_model, info.d = model, coefficients
    image = image_from_depth(raw_depth("plumb_bob", PLANE), "32FC1", Header())
    with pytest.raises(MessageError, match=text) as error:
        view_from_image(image, info, 100.0)
    assert error.value.reason == "distortion"
    assert "image_proc" in str(error.value)
    view_from_image(image, info, 100.0, rectify_depth=False)


def test_depth_of_a_stereo_pair_is_rectified_already() -> None:
    info = info_from_camera(CAMERA, Header())
    info.d, angle = [0.1] * 5, 0.01
    info.r = [np.cos(angle), 0.0, np.sin(angle), 0.0, 1.0, 0.0, -np.sin(angle), 0.0, np.cos(angle)]
    depth = np.linspace(0.5, 2.0, CAMERA.height * CAMERA.width, dtype=np.float32)
    image = image_from_depth(depth.reshape(CAMERA.height, CAMERA.width), "32FC1", Header())
    np.testing.assert_array_equal(view_from_image(image, info, 100.0).points[..., 2].ravel(), depth)


@pytest.mark.parametrize(("model", "size"), [("plumb_bob", 5), ("equidistant", 4)])
@pytest.mark.filterwarnings("error")
def test_coefficients_beyond_all_bounds_leave_nothing_measured(model: str, size: int) -> None:
    raw = CAMERA.resized(40, 30)
    depth = rectify(np.ones((30, 40), np.float32), Distortion(model, (1e30,) * size, raw), raw)
    assert np.isnan(depth).mean() > 0.9


@pytest.mark.parametrize("model", RADIAL)
def test_grey_values_lie_on_the_rays_of_the_pinhole_camera(model: str) -> None:
    target = replace(CAMERA, width=200, height=150, fx=200.0, fy=210.0, cx=95.0, cy=80.0)
    seen = resample(raw_depth(model, PLANE), Distortion(model, RADIAL[model], CAMERA), target)
    v, u = np.indices((target.height, target.width))
    expected = 1.0 / (target.rays(u, v) @ PLANE)
    middle = (slice(20, -20), slice(20, -20))
    np.testing.assert_allclose(seen[middle], expected[middle], atol=2e-3)
