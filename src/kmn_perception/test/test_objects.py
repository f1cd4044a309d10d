"""All objects of a frame: rendered scenes, real frames with their labels, and bad input."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from kmn_perception.estimate import Status
from kmn_perception.model.camera import Camera, look_at
from kmn_perception.model.rendering import depth_to_points, render
from kmn_perception.model.sensor_noise import add_noise
from kmn_perception.pipeline_interface import ObjectEstimate
from kmn_perception.scene.depth_view import DepthView

from .conftest import RealFrame, tabletop_pipeline

KINECT = Camera.load("kinect_v1")
CAMERA = replace(KINECT, pose=look_at([0.0, -0.75, 0.65], [0.0, 0.0, 0.0]))
TABLE = (0.0, 0.0, -0.01, 1.2, 1.2, 0.02, 0.0)
Box = tuple[float, float, float, float, float, float, float]  # centre, size, yaw

pipeline = cache(tabletop_pipeline)


def unit_cube(box: Box) -> NDArray[np.float64]:
    cos, sin = np.cos(box[6]), np.sin(box[6])
    cube = np.eye(4)
    cube[:3, :3] = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]]) @ np.diag(
        box[3:6]
    )
    cube[:3, 3] = box[:3]
    return cube


def seen(depth: NDArray[np.float32]) -> list[ObjectEstimate]:
    """Return what is found in an exact depth image that a Kinect measures."""
    noisy = add_noise(depth, "kinect", np.random.default_rng(0))
    return pipeline().estimate_all(DepthView.of_depth(noisy, KINECT))


def see(*boxes: Box) -> list[ObjectEstimate]:
    """Return what is found of boxes on a table."""
    return seen(render(np.array([unit_cube(box) for box in (TABLE, *boxes)]), CAMERA))


def assert_is(found: ObjectEstimate, box: Box) -> None:
    """Check the sides and the centre, in whatever order and frame (heading is not seen)."""
    assert found.estimate.status is Status.OK, found.estimate.reason
    sides = 0.2 * (1.0 + found.estimate.theta[3:6])
    np.testing.assert_allclose(sorted(sides[:2]), sorted(box[3:5]), atol=0.008)
    assert sides[2] == pytest.approx(box[5], abs=0.004)


def test_every_carton_of_a_real_frame_is_found_and_nothing_else(real_frame: RealFrame) -> None:
    labels = real_frame.labels
    measured = np.isfinite(real_frame.points[..., 2])
    found = pipeline().estimate_all(DepthView(real_frame.points))
    cartons = [label for label in (20, 30, 40) if (labels == label).any()]
    owners = []
    for one in found:
        assert one.estimate.status is Status.OK, one.estimate.reason
        assert not one.truncated
        counts = np.bincount(labels[one.mask], minlength=41)
        owner = int(counts.argmax())
        assert counts[owner] > 0.99 * one.mask.sum()
        assert counts[owner] > 0.93 * (measured & (labels == owner)).sum()
        owners.append(owner)
    assert sorted(owners) == cartons
    distances = [np.linalg.norm(real_frame.points[one.mask], axis=1).mean() for one in found]
    assert distances == sorted(distances)


@pytest.mark.parametrize("yaw", [-0.5, 0.0, 0.4])
def test_boxes_that_touch_are_divided_at_the_concave_edge_between_them(yaw: float) -> None:
    front = (0.0, -0.1, 0.05, 0.16, 0.1, 0.1, 0.0)
    back = (0.05, -0.05 + 0.06 / np.cos(yaw) + 0.12 * abs(np.sin(yaw)), 0.1, 0.3, 0.1, 0.2, yaw)
    found = see(front, back)
    assert len(found) == 2
    assert_is(found[0], front)
    heights = [0.2 * (1.0 + one.estimate.theta[5]) for one in found]
    np.testing.assert_allclose(heights, [0.1, 0.2], atol=0.004)


def test_a_single_box_is_never_divided() -> None:
    for yaw in np.linspace(0.0, np.pi / 2, 5):
        box = (0.0, 0.0, 0.1, 0.25, 0.1, 0.2, float(yaw))
        found = see(box)
        assert len(found) == 1
        assert_is(found[0], box)


def test_a_box_behind_another_is_uncertain_where_it_is_hidden() -> None:
    front = (-0.1, -0.1, 0.1, 0.2, 0.1, 0.2, 0.0)
    back = (0.0, 0.1, 0.125, 0.3, 0.1, 0.25, 0.0)  # reaches out 5 cm beside the front one, at right
    found = see(front, back)
    assert len(found) == 2
    assert_is(found[0], front)
    estimate = found[1].estimate
    sides, spread = 0.2 * (1.0 + estimate.theta[3:6]), np.sqrt(np.diag(estimate.covariance))
    errors = np.abs(np.sort(sides[:2]) - [0.1, 0.3])
    assert (errors < np.maximum(0.008, 2.0 * 0.2 * spread[3:5].max())).all()
    assert sides[2] == pytest.approx(0.25, abs=0.005)


def test_a_small_object_is_told_after_the_others_but_not_estimated() -> None:
    box = (0.0, 0.1, 0.1, 0.25, 0.1, 0.2, 0.3)
    found = see(box, (0.1, -0.2, 0.0125, 0.02, 0.02, 0.025, 0.0))
    assert_is(found[0], box)
    assert [one.estimate.status for one in found[1:]] == [Status.TOO_FEW_POINTS]
    assert "at least 300 are needed" in found[1].estimate.reason


def test_unorganised_points_hide_each_other_too() -> None:
    front = (-0.05, -0.12, 0.1, 0.2, 0.1, 0.2, 0.0)
    back = (0.05, 0.1, 0.1, 0.3, 0.1, 0.2, 0.0)
    depth = render(np.array([unit_cube(box) for box in (TABLE, front, back)]), CAMERA)
    points = depth_to_points(add_noise(depth, "kinect", np.random.default_rng(0)), KINECT)
    cloud = points[np.isfinite(points[..., 2])]
    np.random.default_rng(0).shuffle(cloud)
    found = pipeline().estimate_all(DepthView(cloud))
    assert len(found) == 2
    for one, box in zip(found, (front, back), strict=True):
        assert_is(one, box)
        assert one.mask.shape == (len(cloud),)


PILLAR = (0.0, -0.12, 0.16, 0.06, 0.06, 0.32, 0.0)  # hides a strip from the table to the top


def test_an_object_that_another_one_divides_in_the_image_is_one() -> None:
    behind = (0.01, 0.05, 0.06, 0.34, 0.12, 0.12, 0.1)
    found = see(PILLAR, behind)
    assert len(found) == 2
    for one, box in zip(found, (PILLAR, behind), strict=True):
        assert_is(one, box)
    columns = np.flatnonzero(found[1].mask.any(axis=0))
    assert (np.diff(columns) > 10).any()  # its pixels are on both sides


@pytest.mark.parametrize(
    "other", [(0.1, 0.05, 0.09, 0.12, 0.1, 0.18, 0.0), (0.1, 0.05, 0.06, 0.12, 0.1, 0.12, 0.5)]
)
def test_two_objects_behind_another_one_stay_two(other: Box) -> None:
    first = (-0.1, 0.05, 0.06, 0.12, 0.1, 0.12, 0.0)
    found = see(PILLAR, first, other)
    assert len(found) == 3
    areas = [np.flatnonzero(one.mask.any(axis=0)) for one in found]
    assert all((np.diff(columns) == 1).all() for columns in areas)


@pytest.mark.parametrize(
    "box", [(0.5, 0.0, 0.075, 0.3, 0.1, 0.15, 0.3), (0.0, -0.45, 0.05, 0.2, 0.3, 0.1, 0.3)]
)
def test_a_box_truncated_by_the_border_says_so_and_is_uncertain_there(box: Box) -> None:
    (found,) = see(box)
    assert found.truncated
    spread = 0.2 * np.sqrt(np.diag(found.estimate.covariance))[3:5]
    sides = 0.2 * (1.0 + found.estimate.theta[3:5])
    assert spread.max() > 0.02 > 0.004 > spread.min()
    assert abs(sides[spread.argmin()] - min(box[3:5], key=lambda s: abs(s - sides.min()))) < 0.15


def test_a_box_on_another_one_is_refused() -> None:
    below, above = (0.0, 0.0, 0.05, 0.2, 0.15, 0.1, 0.0), (0.02, 0.02, 0.16, 0.12, 0.1, 0.12, 0.5)
    found = see(below, above)
    stacked = [one for one in found if "stands on another" in one.estimate.reason]
    (standing,) = (one for one in found if one.estimate.status is Status.OK)
    assert len(stacked) == 1
    assert stacked[0].estimate.status is Status.NOT_CONVERGED
    assert_is(standing, below)


def test_round_things_are_no_boxes() -> None:
    rays = depth_to_points(np.ones((480, 640), dtype=np.float32), KINECT) @ CAMERA.pose[:3, :3].T
    eye = CAMERA.pose[:3, 3]
    table = -eye[2] / rays[..., 2]
    table[(table < 0.0) | (table > 2.0)] = np.nan
    generator = np.random.default_rng(1)
    places = [(0.0, 0.0, 0.06, 0.06)]
    places += [(*generator.normal(0.0, 0.05, 2), 0.04, 0.045) for _ in range(12)]
    for spheres in ([places[0]], places[1:]):
        depth = table
        for x, y, z, radius in spheres:
            offset = eye - [x, y, z]
            a, b = (rays**2).sum(axis=-1), rays @ offset
            with np.errstate(invalid="ignore"):
                hit = (-b - np.sqrt(b**2 - a * (offset @ offset - radius**2))) / a
            depth = np.fmin(depth, hit)
        for found in seen(depth.astype(np.float32)):
            assert found.estimate.status is not Status.OK
            assert found.estimate.reason


def test_frames_without_an_object_have_a_reason(real_frame: RealFrame) -> None:
    empty = np.where((real_frame.labels > 1)[..., None], np.nan, real_frame.points)
    turned = real_frame.points[::-1, ::-1] * np.array([-1.0, -1.0, 1.0])
    x, y, z = np.moveaxis(real_frame.points, -1, 0)
    on_right, on_left = np.stack([y, -x, z], axis=-1), np.stack([-y, x, z], axis=-1)
    nowhere = np.where((real_frame.labels == 1)[..., None], np.nan, real_frame.points)
    for points, reason in (
        (empty, "no points of an object"),
        (turned, "the camera is upside down"),
        (np.rot90(on_right), "the camera lies on its right side (portrait)"),
        (np.rot90(on_left, -1), "the camera lies on its left side (portrait)"),
        (nowhere * np.nan, "no support plane"),
    ):
        (none,) = pipeline().estimate_all(DepthView(points.astype(np.float32)))
        assert none.estimate.status is Status.NO_OBJECT
        assert reason in none.estimate.reason
        assert np.isnan(none.estimate.theta).all() and not none.mask.any()


def test_the_nearest_object_is_the_first_of_all(real_frame: RealFrame) -> None:
    alone = pipeline().estimate(DepthView(real_frame.points))
    first = pipeline().estimate_all(DepthView(real_frame.points))[0].estimate
    assert alone.points_used == first.points_used
    np.testing.assert_allclose(alone.theta, first.theta, atol=1e-4)


def test_an_object_with_a_large_hole_keeps_its_size(real_frame: RealFrame) -> None:
    whole = pipeline().estimate_all(DepthView(real_frame.points))[0]
    hole = cv2.erode(whole.mask.astype(np.uint8), np.ones((31, 31), np.uint8)) > 0
    found = pipeline().estimate_all(DepthView(np.where(hole[..., None], np.nan, real_frame.points)))
    estimate = min(
        (one.estimate for one in found),
        key=lambda e: float(np.abs(e.theta[:2] - whole.estimate.theta[:2]).max()),
    )
    assert estimate.status is Status.OK, estimate.reason
    sides, wanted = estimate.theta[3:], whole.estimate.theta[3:]
    np.testing.assert_allclose(np.sort(sides[:2]), np.sort(wanted[:2]), atol=0.05)
    assert sides[2] == pytest.approx(wanted[2], abs=0.03)
