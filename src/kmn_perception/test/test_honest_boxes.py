"""What is no box that stands on the table is not OK; what is one stays OK, within its ellipsoid."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from kmn_perception.estimate import Status
from kmn_perception.evaluation.coverage import is_covered
from kmn_perception.experiments.upright_box import UprightBox
from kmn_perception.model.camera import Camera, look_at
from kmn_perception.model.rendering import depth_to_points
from kmn_perception.model.sensor_noise import add_noise
from kmn_perception.pipeline_interface import FrameBudget, ObjectEstimate
from kmn_perception.scene.depth_view import DepthView

from .conftest import tabletop_pipeline

KINECT = Camera.load("kinect_v1")
CAMERA = replace(KINECT, pose=look_at([0.0, -0.75, 0.65], [0.0, 0.0, 0.0]))
RAYS = depth_to_points(np.ones((480, 640), dtype=np.float32), KINECT) @ CAMERA.pose[:3, :3].T
EYE = CAMERA.pose[:3, 3]
MARCH, NEAR = 60, 1e-4  # steps along a ray, and metres from a surface at which they end
TABLE = 0.6  # metres to each side

Distance = Callable[[NDArray[np.float64]], NDArray[np.float64]]  # of points (N, 3) from a body
pipeline = cache(tabletop_pipeline)


def turned(points: NDArray[np.float64], yaw: float, pitch: float = 0.0) -> NDArray[np.float64]:
    """Return points in the axes of a body that is turned by yaw, then pitched about its own x."""
    cos, sin = np.cos(yaw), np.sin(yaw)
    x, y = points[:, 0] * cos + points[:, 1] * sin, points[:, 1] * cos - points[:, 0] * sin
    cos, sin = np.cos(pitch), np.sin(pitch)
    return np.column_stack([x, y * cos + points[:, 2] * sin, points[:, 2] * cos - y * sin])


def box(
    centre: tuple[float, float, float],
    size: tuple[float, float, float],
    yaw: float = 0.0,
    pitch: float = 0.0,
    radius: float = 0.0,
) -> Distance:
    """Return a cuboid, perhaps with rounded edges."""

    def distance(points: NDArray[np.float64]) -> NDArray[np.float64]:
        off = np.abs(turned(points - centre, yaw, pitch)) - (np.array(size) / 2.0 - radius)
        beyond = np.linalg.norm(np.maximum(off, 0.0), axis=1)
        return beyond + np.minimum(off.max(axis=1), 0.0) - radius

    return distance


def can(
    centre: tuple[float, float, float],
    radius: float,
    height: float,
    yaw: float = 0.0,
    pitch: float = 0.0,
) -> Distance:
    """Return a cylinder; pitched by a quarter turn it lies."""

    def distance(points: NDArray[np.float64]) -> NDArray[np.float64]:
        local = turned(points - centre, yaw, pitch)
        off = np.column_stack(
            [np.linalg.norm(local[:, :2], axis=1) - radius, np.abs(local[:, 2]) - height / 2.0]
        )
        beyond = np.linalg.norm(np.maximum(off, 0.0), axis=1)
        return beyond + np.minimum(off.max(axis=1), 0.0)

    return distance


def depth_of(*bodies: Distance) -> NDArray[np.float32]:
    """Return the exact depth image (480, 640) of bodies on a table, by sphere tracing."""
    table = np.where(RAYS[..., 2] < 0.0, -EYE[2] / RAYS[..., 2], np.nan)
    on = np.abs(EYE + table[..., None] * RAYS)[..., :2].max(axis=-1) < TABLE
    depth = np.where(on, table, np.nan).ravel()
    rays = RAYS.reshape(-1, 3)
    lengths = np.linalg.norm(rays, axis=1)
    far = np.where(np.isfinite(depth), depth, 2.0)
    for body in bodies:
        z = np.full(len(rays), 0.2)
        alive = np.arange(len(rays))
        for _ in range(MARCH):
            off = body(EYE + z[alive, None] * rays[alive])
            z[alive] += off / lengths[alive]
            alive = alive[(off > NEAR) & (z[alive] < far[alive])]
        hit = z < far
        hit[alive] = False
        depth[hit] = np.fmin(depth, z)[hit]
    return depth.reshape(RAYS.shape[:-1]).astype(np.float32)


def see(*bodies: Distance, seed: int = 0, camera: Camera = KINECT) -> list[ObjectEstimate]:
    """Return what is found of bodies on a table that a Kinect sees."""
    noisy = add_noise(depth_of(*bodies), "kinect", np.random.default_rng(seed))
    return pipeline().estimate_all(DepthView.of_depth(noisy, camera))


def tops(found: list[ObjectEstimate]) -> list[float]:
    """Return the heights of those that are OK."""
    return [0.2 * (1.0 + o.estimate.theta[5]) for o in found if o.estimate.status is Status.OK]


ON_OTHERS = {
    "a pot": (can((0.0, 0.0, 0.03), 0.09, 0.06), 0.06, []),
    "a can that lies": (can((0.0, 0.0, 0.04), 0.04, 0.2, 0.4, np.pi / 2.0), 0.08, []),
    "a leaning box": (box((0.0, 0.02, 0.05), (0.22, 0.18, 0.06), 0.0, 0.3), 0.085, []),
    "a box": (box((0.0, 0.0, 0.03), (0.25, 0.18, 0.06), 0.2), 0.06, [0.06]),
    "a pile": (
        lambda points: np.minimum(
            box((0.0, 0.0, 0.025), (0.24, 0.2, 0.05), 0.1)(points),
            can((0.01, 0.01, 0.065), 0.07, 0.03)(points),
        ),
        0.08,
        [0.05],
    ),
}


@pytest.mark.parametrize("below", ON_OTHERS)
def test_what_stands_on_anything_but_the_table_is_not_ok(below: str) -> None:
    """Its height would reach down to the table, whatever was made of what is below."""
    under, level, right = ON_OTHERS[below]
    found = see(under, box((0.0, 0.02, level + 0.06), (0.11, 0.09, 0.12), 0.3))
    highest = max(found, key=lambda one: one.observation.points[:, 2].max())
    assert highest.estimate.status is not Status.OK
    assert highest.estimate.reason
    np.testing.assert_allclose(tops(found), right, atol=0.005)


def test_the_reason_names_what_an_object_stands_on() -> None:
    found = see(can((0.0, 0.0, 0.03), 0.09, 0.06), box((0.0, 0.0, 0.12), (0.1, 0.08, 0.12), 0.3))
    reasons = [one.estimate.reason for one in found]
    assert "the object stands on another one, not on the support plane" in reasons


@pytest.mark.parametrize("radius", [0.03, 0.0375, 0.075])
@pytest.mark.parametrize("shape", ["stands", "lies askew"])
def test_cans_and_cups_are_no_boxes(radius: float, shape: str) -> None:
    lies = shape == "lies askew"
    height = 0.2 if lies else 0.1
    middle = (0.03, -0.05, radius if lies else height / 2.0)
    body = can(middle, radius, height, 0.6, np.pi / 2.0 if lies else 0.0)
    for one in see(body):
        assert one.estimate.status is not Status.OK
        assert one.estimate.reason


def test_a_can_that_is_hidden_in_part_is_no_box_either() -> None:
    pillar = box((0.0, -0.15, 0.12), (0.07, 0.06, 0.24))
    for one in see(can((0.0, 0.0, 0.038), 0.038, 0.24, np.pi / 2.0, np.pi / 2.0), pillar)[1:]:
        assert one.estimate.status is not Status.OK


ROUND = 0.004  # metres
BOXES = [
    UprightBox(np.array([x, y, z / 2.0]), np.array([dx, dy, z]), yaw)
    for x, y, dx, dy, z, yaw in (
        (0.0, 0.0, 0.2, 0.06, 0.15, 0.3),
        (-0.1, 0.1, 0.15, 0.06, 0.24, -0.4),
        (0.05, 0.0, 0.07, 0.06, 0.15, 0.1),
        (0.1, -0.05, 0.25, 0.18, 0.06, 0.6),
        (-0.05, 0.05, 0.13, 0.045, 0.21, 0.5),
        (0.0, -0.1, 0.23, 0.14, 0.07, -0.2),
        (0.1, 0.15, 0.1, 0.1, 0.1, 0.7),
        (-0.15, -0.05, 0.06, 0.16, 0.09, -0.6),
    )
]


def test_rounded_boxes_under_a_camera_with_a_wrong_calibration_lie_in_their_ellipsoids() -> None:
    """Depths and focal lengths are 1 % off, as a standard deviation; edges have a radius of 4 mm.

    The ellipsoids are those of the sizes, which the frame of the support leaves as they are.
    """
    random, model = np.random.default_rng(0), pipeline().model
    covered, counted = 0, 0
    for number, truth in enumerate(BOXES):
        depth = depth_of(box(tuple(truth.centre), tuple(truth.size), truth.yaw, radius=ROUND))
        for seed in (number, 100 + number):
            noisy = add_noise(depth, "kinect", np.random.default_rng(seed))
            off = 1.0 + 0.01 * random.standard_normal(3)
            wrong = replace(KINECT, fx=KINECT.fx * off[1], fy=KINECT.fy * off[2])
            view = DepthView.of_depth((noisy * off[0]).astype(np.float32), wrong)
            (found,) = pipeline().estimate_all(view)
            estimate = found.estimate
            assert estimate.status is Status.OK, estimate.reason
            known = np.concatenate([estimate.theta[:2], truth_parameters(truth)[2:]])
            covariance = estimate.covariance.copy()
            covariance[:2], covariance[:, :2] = 0.0, 0.0
            covariance[[0, 1], [0, 1]] = 1.0
            counted += 1
            covered += is_covered(model, estimate.theta, covariance, known, 0.95)
    assert covered >= 0.85 * counted


def truth_parameters(truth: UprightBox) -> NDArray[np.float64]:
    return np.array([*truth.centre[:2], truth.yaw, *(truth.size / 0.2 - 1.0)])


GRID = [
    box((x, y, 0.025), (0.06, 0.05, 0.05), x + y)
    for x in (-0.3, -0.1, 0.1, 0.3)
    for y in (-0.15, 0.05, 0.25)
]


@pytest.mark.parametrize(
    ("budget", "most"), [(FrameBudget(5, 600.0), 5), (FrameBudget(1000, 0.0), 4)]
)
def test_what_the_budget_of_a_frame_does_not_allow_for_is_told(
    budget: FrameBudget, most: int
) -> None:
    noisy = add_noise(depth_of(*GRID), "kinect", np.random.default_rng(0))
    view = DepthView.of_depth(noisy, KINECT)
    whole = pipeline()
    settings = replace(whole.settings, budget=budget)
    found = whole.configured(settings, whole.estimator.settings).estimate_all(view)
    assert len(found) == len(GRID)
    assert [one.left_out for one in found] == [False] * most + [True] * (len(GRID) - most)
    for one in found[most:]:
        assert one.estimate.status is Status.NOT_CONVERGED
        assert one.estimate.reason.startswith(f"left out: {most} of {len(GRID)} objects were")
        assert one.mask.any() and one.estimate.points_used == one.mask.sum()
    everything = whole.estimate_all(view)
    assert not any(one.left_out for one in everything)
    for one, same in zip(found[:most], everything, strict=False):
        np.testing.assert_allclose(one.estimate.theta, same.estimate.theta, atol=1e-6)
