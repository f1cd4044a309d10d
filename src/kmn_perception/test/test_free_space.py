"""What is known around objects: depths that are measured, gaps beside them, and the border."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from kmn_perception.model.camera import Camera
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.model.observation import FreeSpace, Observation
from kmn_perception.model.rendering import depth_to_cloud, render
from kmn_perception.refinement import Refinement, RefinementSettings, refine
from kmn_perception.scene.free_space import EMPTY, UNKNOWN, free_space, is_truncated

NONE = np.nan
HIGH, ON_SUPPORT = 1.0, 0.0  # metres above the support
BORDER_RUN = 8  # pixels
WIDE = BORDER_RUN + 1
SHADOW = 50.0, 3.0  # pixels by 1 / m, and pixels of slack
CHI_SQUARED = 12.6  # 95 % of six degrees of freedom


def row(*runs: tuple[float, float, int]) -> NDArray[np.float32]:
    """Return one row of points of the depths and heights of runs of pixels."""
    pixels = [(height, 0.0, depth) for depth, height, length in runs for _ in range(length)]
    return np.array([pixels], dtype=np.float32)


def free(points: NDArray[np.float32]) -> NDArray[np.float32]:
    to_world = np.eye(4)[[1, 2, 0, 3]]  # the test's heights are in x
    nothing = np.full(points.shape[:2], -1, dtype=np.int32)
    return free_space(points, nothing, np.eye(4), to_world, 0.01, BORDER_RUN, SHADOW).free_depth[0]


def test_pixels_are_empty_up_to_what_they_show_and_wholly_where_they_show_the_support() -> None:
    points = row((0.7, HIGH, 2), (1.2, ON_SUPPORT, 2))
    np.testing.assert_allclose(free(points), [0.7, 0.7, EMPTY, EMPTY])


def test_a_gap_is_empty_up_to_the_farther_one_of_those_beside_it() -> None:
    for points in (
        row((0.7, HIGH, 1), (NONE, HIGH, 3), (0.9, HIGH, 1)),
        row((0.9, HIGH, 1), (NONE, HIGH, 3), (0.7, HIGH, 1)),
    ):
        np.testing.assert_allclose(free(points)[1:-1], 0.9)
    behind = free(row((0.7, HIGH, 1), (NONE, HIGH, 3), (0.9, ON_SUPPORT, 1)))
    np.testing.assert_allclose(behind[1:-1], 0.9)


@pytest.mark.parametrize("length, known", [(53, 1.0), (54, UNKNOWN)])
@pytest.mark.parametrize("near, far", [(0.5, 1.0), (1.0, 0.5)])
def test_a_gap_wider_than_a_shadow_is_unknown(
    near: float, far: float, length: int, known: float
) -> None:
    points = row((near, HIGH, 2), (NONE, HIGH, length), (far, HIGH, 2))
    np.testing.assert_array_equal(free(points)[2:-2], known)


def test_a_gap_within_an_object_is_unknown() -> None:
    points = row((0.7, HIGH, 2), (NONE, HIGH, 3), (0.8, HIGH, 2))
    labels = np.array([[0, 0, -1, -1, -1, 0, 0]], dtype=np.int32)
    known = free_space(
        points, labels, np.eye(4), np.eye(4), -np.inf, BORDER_RUN, SHADOW
    ).free_depth[0]
    np.testing.assert_allclose(known, [0.7, 0.7, UNKNOWN, UNKNOWN, UNKNOWN, 0.8, 0.8])
    labels[0, -2:] = 1
    other = free_space(
        points, labels, np.eye(4), np.eye(4), -np.inf, BORDER_RUN, SHADOW
    ).free_depth[0]
    np.testing.assert_allclose(other[2:5], 0.8)


@pytest.mark.parametrize("length, known", [(BORDER_RUN, UNKNOWN), (WIDE, EMPTY)])
def test_a_narrow_gap_at_the_border_is_unknown(length: int, known: float) -> None:
    gap, seen = (NONE, HIGH, length), (0.7, HIGH, 4)
    np.testing.assert_array_equal(free(row(gap, seen))[:length], known)
    np.testing.assert_array_equal(free(row(seen, gap))[4:], known)


@pytest.mark.parametrize("length, known", [(BORDER_RUN, UNKNOWN), (WIDE, EMPTY)])
@pytest.mark.parametrize("upside_down", [False, True])
def test_narrow_gaps_at_the_top_and_the_bottom_are_unknown(
    length: int, known: float, upside_down: bool
) -> None:
    column = row((NONE, HIGH, length), (0.7, HIGH, 12)).transpose(1, 0, 2)
    image = np.ascontiguousarray(np.repeat(column[::-1] if upside_down else column, 20, axis=1))
    nothing = np.full(image.shape[:2], -1, dtype=np.int32)
    to_world = np.eye(4)[[1, 2, 0, 3]]
    seen = free_space(image, nothing, np.eye(4), to_world, 0.01, BORDER_RUN, SHADOW).free_depth
    seen = seen[::-1] if upside_down else seen
    np.testing.assert_array_equal(seen[:length], known)
    np.testing.assert_allclose(seen[length:], 0.7)


def test_what_was_not_measured_is_marked_as_interpolated() -> None:
    points = row((0.7, HIGH, 1), (NONE, HIGH, 2))
    around = free_space(points, np.zeros((1, 3), np.int32), np.eye(4), np.eye(4), 0.0, 0, SHADOW)
    np.testing.assert_array_equal(around.interpolated, [[False, True, True]])


@pytest.mark.parametrize(
    "column, touches", [(0, False), (2, True), (5, False), (10, False), (12, False), (18, True)]
)
def test_an_object_touches_the_border_or_a_narrow_gap_beside_it(column: int, touches: bool) -> None:
    free_depth = np.full((9, 20), EMPTY, dtype=np.float32)
    free_depth[:, :2] = UNKNOWN
    free_depth[:, 19] = UNKNOWN
    free_depth[:, 11] = UNKNOWN  # a gap within an object
    mask = np.zeros(free_depth.shape, dtype=np.bool_)
    mask[4, column] = True
    assert is_truncated(mask, free_depth) == touches
    upright = np.ascontiguousarray(mask.T), np.ascontiguousarray(free_depth.T)
    assert is_truncated(*upright) == touches


@pytest.mark.parametrize("hidden", [0.2, 0.35, 0.5])
def test_what_an_occluder_hides_is_left_uncertain_and_does_not_bend_the_fit(hidden: float) -> None:
    model, settings = KinematicModel.load("box"), RefinementSettings.load()
    camera = Camera.load("kinect_v1")
    camera = replace(camera, pose=model.camera.pose)
    truth = np.array([0.03, -0.05, 0.2, 0.25, -0.2, -0.1])
    depth = render(model.unit_cubes(*model.split(truth)), camera)
    columns = np.flatnonzero(np.isfinite(depth).any(axis=0))
    edge = int(np.quantile(columns, 1.0 - hidden))
    depth[:, edge:] = np.nan
    free_depth = np.full(depth.shape, EMPTY, dtype=np.float32)
    free_depth[:, edge:] = 0.3  # metres to the occluder
    around = FreeSpace(free_depth, np.zeros(depth.shape, dtype=np.bool_))
    points = depth_to_cloud(depth, camera)
    start = truth + [0.01, 0.01, 0.03, -0.1, 0.1, 0.05]
    known = refine(model, Observation(points, camera, free_space=around), start, settings)
    blind = refine(model, Observation(points, camera), start, settings)

    assert np.abs(known.values - truth)[[2, 5]].max() < 2e-3  # yaw and height are in view
    assert _far(known, truth) < CHI_SQUARED < _far(blind, truth)
    sides = np.sqrt(np.diag(known.covariance))[3:5]
    assert sides.max() > 0.02  # the hidden end is unobservable


def _far(fit: Refinement, truth: NDArray[np.float64]) -> float:
    """Return the squared Mahalanobis distance of the truth from a fit."""
    offset = fit.values - truth
    return float(offset @ np.linalg.solve(fit.covariance + 1e-6 * np.eye(6), offset))
