"""References from labels: scenes of known boxes, and real cartons that appear again and again."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from kmn_perception.configuration.resources import share_directory
from kmn_perception.experiments.labelled_frame import LabelledFrame, read_frames
from kmn_perception.experiments.reference import Reference, measure
from kmn_perception.experiments.settings import ExperimentSettings
from kmn_perception.experiments.upright_box import UprightBox, errors, intersection_over_union
from kmn_perception.model.camera import Camera
from kmn_perception.model.rendering import render
from kmn_perception.model.sensor_noise import add_noise

CAMERA = Camera.load("kinect_v1")
TABLE = UprightBox(np.array([0.0, 0.0, -0.05]), np.array([1.4, 1.6, 0.1]), 0.0)


def _settings(camera: Camera = CAMERA) -> ExperimentSettings:
    return replace(ExperimentSettings.load(), camera=camera)


def _box(x: float, y: float, yaw_deg: float, size: Sequence[float]) -> UprightBox:
    return UprightBox(np.array([x, y, size[2] / 2.0]), np.array(size), np.radians(yaw_deg))


def _scene(boxes: Sequence[UprightBox], noise: str, camera: Camera = CAMERA) -> LabelledFrame:
    """Render boxes on a table, labelled by what is nearest to the measured depth."""
    solids = [TABLE, *boxes]
    alone = np.stack([render(solid.unit_cube[None], camera) for solid in solids])
    exact = np.fmin.reduce(alone)
    depth = add_noise(exact, noise, np.random.default_rng(1))
    off = np.where(np.isfinite(alone), np.abs(alone - depth), np.inf)
    labels = np.array([1, 20, 30, 40], dtype=np.uint8)[off.argmin(axis=0)]
    labels[~np.isfinite(off.min(axis=0))] = 0
    return LabelledFrame("scene", depth, labels)


def _measure(boxes: Sequence[UprightBox], noise: str, camera: Camera = CAMERA) -> list[Reference]:
    return measure(_scene(boxes, noise, camera), _settings(camera), camera.pose).boxes


SCENES = [
    [_box(0.0, 0.1, 20.0, [0.15, 0.06, 0.24])],
    [_box(-0.1, 0.0, -35.0, [0.13, 0.07, 0.21]), _box(0.15, 0.25, 8.0, [0.23, 0.06, 0.15])],
    [_box(0.1, -0.1, 43.0, [0.2, 0.1, 0.07]), _box(-0.2, 0.2, 5.0, [0.08, 0.065, 0.15])],
]


@pytest.mark.parametrize("boxes", SCENES)
@pytest.mark.parametrize(
    ("noise", "yaw_deg", "size"),
    [("none", 0.1, 0.0015), ("mm", 0.2, 0.002), ("kinect", 0.8, 0.005)],
)
def test_known_boxes_are_measured_within_their_stated_deviation(
    boxes: list[UprightBox], noise: str, yaw_deg: float, size: float
) -> None:
    found = _measure(boxes, noise)
    assert len(found) == len(boxes)
    for reference, truth in zip(found, boxes, strict=True):
        assert reference.in_view.all()
        assert reference.visible > 0.9
        off = errors(reference.box, truth)
        assert np.degrees(off.yaw) < yaw_deg
        assert off.yaw < 3.0 * reference.yaw_deviation
        assert off.size.max() < size
        below, above = reference.side_deviations[[0, 2]], reference.side_deviations[[1, 3]]
        stated = np.array([*np.hypot(below, above), reference.side_deviations[4]])
        same = truth.as_near(reference.box)
        assert (np.abs(reference.box.size - same.size) < 3.0 * stated).all()
        assert off.centre < size
        assert intersection_over_union(reference.box, truth) > 0.9


def test_a_side_that_something_hides_is_not_in_view() -> None:
    boxes = [_box(0.0, 0.2, 3.0, [0.24, 0.06, 0.15]), _box(0.12, 0.05, 0.0, [0.13, 0.05, 0.24])]
    hidden, before = _measure(boxes, "kinect")
    assert before.in_view.all()
    np.testing.assert_array_equal(hidden.in_view, [True, False, True, True, True])
    np.testing.assert_array_equal(hidden.sizes_in_view, [False, True, True])
    assert hidden.box.size[0] < 0.24 - 0.02


def test_a_side_beyond_the_image_is_not_in_view() -> None:
    boxes = [_box(0.55, -0.1, 2.0, [0.24, 0.06, 0.15])]
    (cut,) = _measure(boxes, "none")
    np.testing.assert_array_equal(cut.in_view, [True, False, True, True, True])


@pytest.mark.parametrize("pixels", [1, 50, 400])
def test_an_object_of_which_no_upright_face_is_seen_is_not_measured(pixels: int) -> None:
    scene = _scene([_box(0.0, 0.1, 20.0, [0.25, 0.16, 0.08])], "kinect")
    rows, columns = np.nonzero(scene.labels == 20)
    few = scene.labels.copy()
    few[rows[pixels:], columns[pixels:]] = 0  # of the far part of the top alone
    assert not measure(replace(scene, labels=few), _settings(), CAMERA.pose).boxes


def test_half_of_an_object_behind_another_is_seen_as_half() -> None:
    near, far = _box(0.0, 0.0, 0.0, [0.12, 0.05, 0.2]), _box(0.0, 0.08, 0.0, [0.25, 0.06, 0.2])
    scene = _scene([far, near], "none")
    hidden = measure(scene, _settings(), CAMERA.pose).boxes[0]
    silhouette = np.isfinite(render(far.unit_cube[None], CAMERA))
    share = (scene.labels == 20).sum() / silhouette.sum()
    assert 0.3 < share < 0.8
    assert hidden.visible == pytest.approx(share, abs=0.03)


@pytest.mark.parametrize("turns", range(4))
def test_turned_axes_keep_each_deviation_with_its_side(turns: int) -> None:
    box = _box(0.1, 0.2, 10.0, [0.2, 0.1, 0.3])
    reference = Reference(20, box, 0.01, np.array([1.0, 2.0, 3.0, 4.0, 5.0]), 1.0)
    turned = reference.as_near(box.turned(turns))
    for side in range(4):
        world = _middle(reference.box, side)
        same = [_middle(turned.box, s) for s in range(4)]
        other = int(np.argmin(np.linalg.norm(np.array(same) - world, axis=1)))
        assert turned.side_deviations[other] == reference.side_deviations[side]


def _middle(box: UprightBox, side: int) -> NDArray[np.float64]:
    """Return the middle of the sides -x, +x, -y, +y."""
    corner = np.zeros(4)
    corner[side // 2], corner[3] = (0.5 if side % 2 else -0.5), 1.0
    return np.asarray((box.unit_cube @ corner)[:3])


def test_parameters_scatter_as_their_covariance_says() -> None:
    box = _box(0.1, 0.2, 25.0, [0.2, 0.1, 0.3])
    deviations = np.array([0.001, 0.004, 0.002, np.inf, 0.003])
    mean, covariance = Reference(20, box, 0.01, deviations, 1.0).parameters(unseen=0.02)
    random = np.random.default_rng(0)
    sides = random.normal(size=(100_000, 5)) * np.where(np.isfinite(deviations), deviations, 0.02)
    cos, sin = np.cos(box.yaw), np.sin(box.yaw)
    shift = np.column_stack([(sides[:, 0] + sides[:, 1]) / 2, (sides[:, 2] + sides[:, 3]) / 2])
    drawn = np.column_stack(
        [
            shift @ [cos, -sin],
            shift @ [sin, cos],
            0.01 * random.normal(size=len(sides)),
            sides[:, 1] - sides[:, 0],
            sides[:, 3] - sides[:, 2],
            sides[:, 4],
        ]
    )
    np.testing.assert_allclose(mean, [0.1, 0.2, box.yaw, 0.2, 0.1, 0.3])
    np.testing.assert_allclose(np.cov(drawn.T), covariance, rtol=0.05, atol=2e-6)


def test_the_same_cartons_measure_the_same_in_every_frame() -> None:
    settings, heading = _settings(), Camera.load("box").pose
    frames = read_frames(share_directory() / "data" / "kinect_boxes")
    found = [r for frame in frames for r in measure(frame, settings, heading).boxes]
    assert len(found) == 38
    for height, width in ((0.213, 0.131), (0.155, 0.235), (0.245, 0.147)):
        same = [r for r in found if abs(r.box.size[2] - height) < 0.005]
        assert len(same) >= 6
        heights = np.array([r.box.size[2] for r in same])
        assert np.ptp(heights) < 0.004
        widths = [r.box.size[:2].max() for r in same if r.sizes_in_view.all()]
        assert np.median(widths) == pytest.approx(width, abs=0.004)
        assert np.ptp(widths) < 0.01
