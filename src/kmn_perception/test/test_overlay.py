"""Pictures of predicted models."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from matplotlib.colors import to_rgb
from matplotlib.image import imread
from numpy.typing import NDArray

from kmn_perception.model.camera import Camera, look_at
from kmn_perception.model.rendering import depth_to_points, render
from kmn_perception.model.transformation import transform_points
from kmn_perception.visualization.overlay import (
    ACCEPTED,
    EDGE_PIECES,
    OBJECT,
    REFERENCE,
    REFUSED,
    Bodies,
    Overlay,
    ShownObject,
    save_contact_sheet,
    save_picture,
    wireframe,
)

CAMERA = Camera(320, 240, 260.0, 260.0, 159.5, 119.5, look_at([-1.0, -1.2, 0.9], [0, 0, 0]))


def _cuboid(centre: tuple[float, float, float], size: float) -> NDArray[np.float64]:
    cube = np.diag([size, size, size, 1.0])
    cube[:3, 3] = centre
    return cube


def _pixels(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Project points (N, 3) by OpenCV."""
    rotation, _ = cv2.Rodrigues(CAMERA.world_to_camera[:3, :3])
    matrix = np.array([[CAMERA.fx, 0, CAMERA.cx], [0, CAMERA.fy, CAMERA.cy], [0, 0, 1]])
    projected, _ = cv2.projectPoints(
        points, rotation, CAMERA.world_to_camera[:3, 3], matrix, np.zeros(5)
    )
    return projected[:, 0].astype(np.float64)


def _distance(
    point: NDArray[np.float64], start: NDArray[np.float64], end: NDArray[np.float64]
) -> float:
    """Distance of a pixel from a straight line between two others."""
    along = np.clip((point - start) @ (end - start) / ((end - start) @ (end - start)), 0.0, 1.0)
    return float(np.linalg.norm(start + along * (end - start) - point))


def test_of_a_box_seen_from_a_corner_the_three_edges_at_the_far_corner_are_hidden() -> None:
    visible, hidden = wireframe(Bodies.of(_cuboid((0, 0, 0), 0.4)[None]), CAMERA)
    assert len(visible) == pytest.approx(9 * EDGE_PIECES, abs=3)
    assert len(hidden) == pytest.approx(3 * EDGE_PIECES, abs=3)
    far, *ends = _pixels(
        np.array([(0.2, 0.2, -0.2), (-0.2, 0.2, -0.2), (0.2, -0.2, -0.2), (0.2, 0.2, 0.2)])
    )
    for pixel in hidden.reshape(-1, 2).astype(np.float64):
        assert min(_distance(pixel, far, end) for end in ends) < 0.1


def test_a_body_behind_another_is_hidden() -> None:
    towards_camera = CAMERA.pose[:3, 3] / np.linalg.norm(CAMERA.pose[:3, 3])
    front, rear = _cuboid(tuple(0.5 * towards_camera), 0.4), _cuboid((0, 0, 0), 0.1)
    alone, _ = wireframe(Bodies.of(front[None]), CAMERA)
    visible, hidden = wireframe(Bodies.of(np.stack([rear, front])), CAMERA)
    assert len(visible) == len(alone)
    assert len(visible) + len(hidden) == 2 * 12 * EDGE_PIECES


def test_a_body_in_front_hides_no_more_than_its_outline() -> None:
    beside = [_cuboid((0.0, 0.0, 0.0), 0.2), _cuboid((0.5, -0.4, 0.0), 0.2)]
    together, _ = wireframe(Bodies.of(np.stack(beside)), CAMERA)
    assert len(together) == sum(len(wireframe(Bodies.of(cube[None]), CAMERA)[0]) for cube in beside)


def _overlay(accepted: bool) -> Overlay:
    cubes = _cuboid((0, 0, 0), 0.4)[None]
    depth = render(cubes, CAMERA)
    seen = depth_to_points(depth, CAMERA)[np.isfinite(depth)]
    shown = ShownObject(transform_points(CAMERA.pose, seen), cubes, accepted)
    return Overlay(depth, CAMERA, [shown], "a box")


def _count(picture: Path, colour: str) -> int:
    """Count the pixels of a colour."""
    rgb = imread(picture)[..., :3]
    return int((np.abs(rgb - np.array(to_rgb(colour))).max(axis=2) < 0.03).sum())


def test_the_picture_shows_a_valid_prediction_in_green_and_a_refused_one_in_red(
    tmp_path: Path,
) -> None:
    save_picture(tmp_path / "valid.png", _overlay(accepted=True))
    save_picture(tmp_path / "refused.png", _overlay(accepted=False))
    assert _count(tmp_path / "valid.png", ACCEPTED) > 1000
    assert _count(tmp_path / "valid.png", REFUSED) == 0
    assert _count(tmp_path / "refused.png", REFUSED) > 1000
    assert _count(tmp_path / "refused.png", ACCEPTED) == 0


def test_without_a_prediction_the_scene_alone_is_shown(tmp_path: Path) -> None:
    nothing = replace(_overlay(accepted=False), objects=[])
    save_picture(tmp_path / "nothing.png", nothing)
    assert _count(tmp_path / "nothing.png", REFUSED) == 0
    assert _count(tmp_path / "nothing.png", OBJECT) == 0


def test_several_objects_each_have_their_colour_and_hide_each_other(tmp_path: Path) -> None:
    one = _overlay(accepted=True)
    behind = ShownObject(
        np.empty((0, 3), np.float32), _cuboid((0.45, 0.5, 0.0), 0.3)[None], accepted=False
    )
    save_picture(tmp_path / "both.png", replace(one, objects=[*one.objects, behind]))
    save_picture(tmp_path / "behind.png", replace(one, objects=[behind]))
    assert _count(tmp_path / "both.png", ACCEPTED) > 1000
    assert 100 < _count(tmp_path / "both.png", REFUSED) < _count(tmp_path / "behind.png", REFUSED)


def test_references_are_drawn_beside(tmp_path: Path) -> None:
    save_picture(
        tmp_path / "both.png",
        replace(_overlay(accepted=True), references=_cuboid((0, 0, 0), 0.3)[None]),
    )
    assert _count(tmp_path / "both.png", REFERENCE) > 100


def test_the_contact_sheet_shows_every_frame(tmp_path: Path) -> None:
    overlays = [_overlay(accepted=number != 3) for number in range(7)]
    save_contact_sheet(tmp_path / "sheet.png", overlays)
    height, width, _ = imread(tmp_path / "sheet.png").shape
    single = _count(tmp_path / "sheet.png", REFUSED)
    assert single > 100
    assert _count(tmp_path / "sheet.png", ACCEPTED) == pytest.approx(6 * single, rel=0.2)
    assert width > 2 * height
