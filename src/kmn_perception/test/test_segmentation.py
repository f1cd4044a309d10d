"""Background removal: rendered scenes, clusters against other libraries, real frames."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import cv2
import networkx
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray

from kmn_perception.model.camera import Camera
from kmn_perception.model.rendering import depth_to_points, render
from kmn_perception.model.transformation import transform_points
from kmn_perception.scene import segmentation
from kmn_perception.scene.segmentation import SegmentationSettings
from kmn_perception.scene.settings import SceneSettings
from kmn_perception.scene.support_plane import SupportPlaneSettings, find_support_plane, pose_above

from .conftest import cuboid

SETTINGS = SegmentationSettings(
    crop=True,
    crop_min=(-1.0, -1.0, -0.2),
    crop_max=(1.0, 1.0, 1.0),
    remove_plane=True,
    plane_margin=0.008,
    cluster=True,
    cluster_step=0.02,
    cluster_min_points=50,
    cluster_concave_angle=0.5,
)
SCENE = SceneSettings.load()
RAISED = SCENE.raised_plane
OFF = replace(SETTINGS, crop=False, remove_plane=False, cluster=False)
CAMERA = Camera.load("box").resized(320, 240)
KINECT_V1 = np.array([[525.0, 0.0, 319.5], [0.0, 525.0, 239.5], [0.0, 0.0, 1.0]])
TABLE = cuboid((1.6, 1.6, 0.02), (0.0, 0.0, -0.01))
NEAR_BOX = cuboid((0.2, 0.1, 0.1), (-0.1, -0.2, 0.05))
FAR_BOX = cuboid((0.3, 0.1, 0.3), (0.1, 0.1, 0.15))
WALL = cuboid((4.0, 0.02, 4.0), (0.0, 1.2, 0.0))


def view(*cuboids: NDArray[np.float64]) -> NDArray[np.float32]:
    return depth_to_points(render(np.array(cuboids), CAMERA), CAMERA)


def nearest(
    points: NDArray[np.float32],
    pose: NDArray[np.float64],
    viewpoint: NDArray[np.float64],
    settings: SegmentationSettings = SETTINGS,
) -> NDArray[np.float32]:
    """Return the nearest object's points in the world frame."""
    return segmentation.segment(points, pose, viewpoint, settings, SCENE).of_object(0)


def segment(
    points: NDArray[np.float32], settings: SegmentationSettings = SETTINGS
) -> NDArray[np.float32]:
    return nearest(points, CAMERA.pose, CAMERA.pose[:3, 3], settings)


def distances(points: NDArray[np.float32], cube: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return how far points lie outside a cuboid along its worst axis, metres."""
    offsets = np.abs(points - cube[:3, 3]) - np.diag(cube)[:3] / 2
    return offsets.max(axis=1)


@pytest.mark.parametrize("organised", [True, False])
def test_nearest_box_is_left_of_a_whole_scene(organised: bool) -> None:
    points = view(TABLE, NEAR_BOX, FAR_BOX, WALL)
    found = segment(points if organised else points.reshape(-1, 3))
    assert np.abs(distances(found, NEAR_BOX)).max() < 1e-4
    alone = transform_points(CAMERA.pose, view(NEAR_BOX)).reshape(-1, 3)
    assert len(found) == (alone[:, 2] >= SETTINGS.plane_margin).sum()


def test_boxes_that_touch_are_told_apart_at_the_step_between_them() -> None:
    tall = cuboid((0.2, 0.1, 0.3), (0.0, -0.2, 0.15))
    wide = cuboid((0.6, 0.1, 0.1), (0.0, -0.1, 0.05))  # stands at the tall one's back
    found = segment(view(TABLE, tall, wide))
    assert np.abs(distances(found, tall)).max() < 1e-4


def test_near_crumbs_are_no_object() -> None:
    crumb = cuboid((0.01, 0.01, 0.03), (0.0, -0.4, 0.015))
    found = segment(view(TABLE, crumb, FAR_BOX))
    assert np.abs(distances(found, FAR_BOX)).max() < 1e-4


@pytest.mark.parametrize("organised", [True, False])
@pytest.mark.parametrize("cluster", [True, False])
def test_empty_table_holds_no_object(organised: bool, cluster: bool) -> None:
    points = view(TABLE)
    found = segment(
        points if organised else points.reshape(-1, 3), replace(SETTINGS, cluster=cluster)
    )
    assert found.shape == (0, 3)


def test_each_stage_removes_what_it_is_for() -> None:
    points = view(TABLE, NEAR_BOX, FAR_BOX, WALL)
    world = transform_points(CAMERA.pose, points).reshape(-1, 3)
    np.testing.assert_allclose(segment(points, OFF), world[np.isfinite(world[:, 0])], atol=1e-6)
    cropped = segment(points, replace(OFF, crop=True))
    assert 0 < len(cropped) < np.isfinite(world[:, 0]).sum()
    assert (cropped >= SETTINGS.crop_min).all() and (cropped <= SETTINGS.crop_max).all()
    above = segment(points, replace(OFF, remove_plane=True))
    assert len(above) == (world[:, 2] >= SETTINGS.plane_margin).sum()
    clustered = segment(points, replace(OFF, cluster=True))
    assert np.abs(distances(clustered, TABLE)).min() < 1e-4  # table and boxes hang together


@settings(deadline=None)
@given(arrays(np.bool_, st.tuples(st.integers(2, 12), st.integers(2, 12))))
def test_image_clusters_are_the_connected_components(mask: NDArray[np.bool_]) -> None:
    rows, columns = np.indices(mask.shape)
    grid = np.stack([columns, rows, np.zeros(mask.shape)], axis=-1).astype(np.float32)
    points = np.where(mask[..., None], grid, np.float32(np.nan))
    count, labels = cv2.connectedComponents(mask.astype(np.uint8), connectivity=4)
    found = nearest(
        points,
        np.eye(4),
        np.array([-100.0, -1.0, 0.0]),
        replace(OFF, cluster=True, cluster_step=1.0, cluster_min_points=1),
    )
    components = [grid[labels == label] for label in range(1, count)]
    assert (len(found) == 0) == (not components)
    assert not components or any(np.array_equal(found, component) for component in components)


@settings(deadline=None)
@given(arrays(np.bool_, st.tuples(*[st.integers(1, 5)] * 3)))
def test_cloud_clusters_are_the_connected_voxels(voxels: NDArray[np.bool_]) -> None:
    occupied = np.argwhere(voxels)
    graph = networkx.Graph()
    graph.add_nodes_from(map(tuple, occupied))
    graph.add_edges_from(
        (a, b) for a in graph for b in graph if max(np.abs(np.subtract(a, b))) == 1
    )
    found = nearest(
        occupied.astype(np.float32) + np.float32(0.5),
        np.eye(4),
        np.array([-100.0, -1.0, 0.0]),
        replace(OFF, cluster=True, cluster_step=1.0, cluster_min_points=1),
    )
    components = [set(component) for component in networkx.connected_components(graph)]
    assert (len(found) == 0) == (not components)
    assert not components or {tuple(p) for p in (found - 0.5).astype(int)} in components


def test_one_carton_is_left_of_a_real_frame(real_frame: Any) -> None:
    plane = find_support_plane(
        real_frame.points, SupportPlaneSettings(0.01, np.radians(75.0), 0.2, RAISED)
    )
    assert plane is not None
    pose = pose_above(plane, CAMERA.pose)
    found = nearest(real_frame.points, pose, pose[:3, 3])
    x, y, z = KINECT_V1 @ pose[:3, :3].T @ (found - pose[:3, 3]).T
    labels = real_frame.labels[np.rint(y / z).astype(int), np.rint(x / z).astype(int)]
    counts = np.bincount(labels)
    measured = np.isfinite(real_frame.points[..., 2])
    assert counts.argmax() >= 20  # a carton, neither table nor floor
    assert counts.max() > 0.99 * len(found)
    assert counts.max() > 0.95 * (measured & (real_frame.labels == counts.argmax())).sum()
