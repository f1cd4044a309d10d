"""Cells of a wall's view, and what is to be found in them, against steps and projections."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from kmn_perception.doors.settings import DoorSettings
from kmn_perception.doors.view_cells import cells_of, height_of
from kmn_perception.doors.wall_view import WallFrame, WallView, view_wall
from kmn_perception.network.wall_network import EDGES, KINDS
from kmn_perception.rooms.frame import Frame, make_frame
from kmn_perception.training.wall.settings import WallTrainingSettings
from kmn_perception.training.wall.targets import NO_HANDLE, Target, target_of

DOORS = DoorSettings.load()
SETTINGS = WallTrainingSettings.load("room_door").target
NOISE, PIXEL = DOORS.fit.pixel_noise, DOORS.view.pixel
BEFORE = DOORS.view.before * NOISE
HIGH, WIDE = 8 * PIXEL, 4 * PIXEL  # of a cell, metres
RIGHT, DOWN, OFFSET, MEASURED, INSIDE, FRONT = range(6)


def blank(columns: int = 200) -> WallView:
    """Return the view of a grey wall, 2 m away."""
    x, y, z = np.eye(3)
    s = np.asarray(PIXEL * np.arange(columns), dtype=np.float64)
    heights = np.arange(*DOORS.view.heights[::-1], -PIXEL, dtype=np.float64)
    shape = (len(heights), columns)
    return WallView(
        frame=WallFrame(-z, x, -y, 2.0, 1.0),
        s=s,
        z=heights,
        grey=np.full(shape, -1.0, np.float32),
        offset=np.zeros(shape, np.float32),
        inside=np.ones(shape, np.bool_),
        footprint=np.full(columns, 0.003),
    )


def cells(view: WallView) -> NDArray[np.float32]:
    return cells_of(view, NOISE, BEFORE)


@pytest.mark.parametrize("step", [0.2, -0.2])
def test_an_upright_step_of_grey_is_in_its_column_with_its_sign(step: float) -> None:
    view = blank()
    assert view.grey is not None
    view.grey[:, 102:] += np.float32(step)  # in the middle of cells 25, columns 100 to 103
    right = cells(view)[RIGHT, 20:40]
    assert (np.abs(right).argmax(axis=1) == 25).all()
    np.testing.assert_allclose(right[:, 25], step / 0.4, rtol=0.05)
    assert np.abs(cells(view)[DOWN, 20:40]).max() < 1e-6


def test_a_level_step_of_grey_is_in_its_row_and_darker_below_is_negative() -> None:
    view = blank()
    assert view.grey is not None
    view.grey[164:] -= np.float32(0.1)  # in the middle of cells 20, rows 160 to 167
    down = cells(view)[DOWN, :, 5:-5]
    assert (np.abs(down).argmax(axis=0) == 20).all()
    np.testing.assert_allclose(down[20], -0.1 / 0.4, rtol=0.05)


def test_offsets_count_in_noises_and_what_is_before_the_wall_is_marked() -> None:
    view = blank()
    view.offset[80:160, 40:80] = 3.0 * NOISE  # nearer, cells 10 to 19 and 10 to 19
    view.offset[80:160, 120:160] = 2.0 * BEFORE
    view.offset[240:, :] = np.nan
    found = cells(view)
    np.testing.assert_allclose(found[OFFSET, 10:20, 10:20], 3.0 / 12.0, rtol=1e-4)
    assert (found[FRONT, 10:20, 10:20] == -1.0).all()
    assert (found[OFFSET, 10:20, 30:40] == 1.0).all()  # clipped
    assert (found[FRONT, 10:20, 30:40] == 1.0).all()
    assert (found[MEASURED, :30] == 1.0).all()
    assert (found[MEASURED, 30:] == -1.0).all()
    assert (found[OFFSET, 30:] == 0.0).all()


def test_a_mirrored_view_has_mirrored_cells_of_the_other_sign() -> None:
    view, generator = blank(), np.random.default_rng(0)
    assert view.grey is not None
    noise = generator.standard_normal(view.grey.shape).astype(np.float32)
    grey = np.asarray(cv2.GaussianBlur(noise, (0, 0), 3.0), dtype=np.float32)
    offset = (grey * NOISE).astype(np.float32)
    there = cells(replace(view, grey=grey, offset=offset))
    mirrored = replace(view, s=-view.s[::-1])
    back = cells(replace(mirrored, grey=grey[:, ::-1].copy(), offset=offset[:, ::-1].copy()))
    np.testing.assert_allclose(back[DOWN], there[DOWN, :, ::-1], atol=1e-5)
    np.testing.assert_allclose(back[RIGHT], -there[RIGHT, :, ::-1], atol=1e-5)
    np.testing.assert_allclose(back[OFFSET:-1], there[OFFSET:-1, :, ::-1], atol=1e-5)
    np.testing.assert_allclose(back[-1], -there[-1, :, ::-1], atol=1e-5)
    slope = (view.s[-1] - view.s[0]) / view.frame.distance / 2.0  # where 1 is at a tangent of 2
    assert float(there[-1, 0, -1] - there[-1, 0, 0]) == pytest.approx(slope, rel=0.02)


@pytest.fixture(scope="module")
def doors() -> list[tuple[Frame, WallView]]:
    """Return rendered doors, and the views of their walls where these truly are."""
    found = []
    for seed in (1, 2, 3, 11, 15, 21, 25, 29):  # flush, and from 11 on recessed
        frame = make_frame(seed, "none")
        to_camera = frame.room.camera.world_to_camera[:3, :3]
        normal = -to_camera @ frame.room.wall[:3, 0]
        at = frame.room.camera.world_to_camera @ frame.room.wall[:, 3]
        vector = -normal / abs(float(at[:3] @ normal))
        height = float(frame.room.camera.pose[2, 3])
        wall = WallFrame.of(vector, to_camera @ [0.0, 0.0, 1.0], height)
        view = view_wall(wall, np.nan_to_num(frame.depth), None, frame.room.camera, DOORS.view)
        assert view is not None
        found.append((frame, view))
    return found


def found_target(frame: Frame, view: WallView) -> Target:
    return target_of(view, frame.room, frame.images, SETTINGS)


def test_targets_are_where_the_camera_sees_the_doors_edges(
    doors: list[tuple[Frame, WallView]],
) -> None:
    """A cell's place on the wall, projected by the camera, is the pixel of the corner itself."""
    compared = 0
    flush = 0
    for frame, view in doors:
        target, door, camera = found_target(frame, view), frame.room.door, frame.room.camera
        assert door is not None
        assert target.door == 1.0
        if abs(door.nuisance["opening"]) > 0.0:
            continue
        recess = max(door.nuisance["recess"], 0.0)
        before = door.nuisance["recess"] + door.nuisance["frame_proud"]
        outwards = door.frame[:3, 0] @ camera.pose[:3, :3]  # into the wall
        for name in EDGES:
            column, side = getattr(target, name), name.removeprefix("panel_")
            if np.isnan(column):
                continue
            edge = (door.corners[f"top_{side}"] + door.corners[f"bottom_{side}"]) / 2.0
            if name == side:  # the frame's
                edge = edge - before * outwards
            end = camera.matrix @ edge
            # Up and down the wall a column is a line, which the edge's middle is on.
            s = view.s[0] + (column + 0.375) * WIDE
            up = float(edge @ view.frame.up) + view.frame.height
            at = camera.matrix @ view.frame.points(np.array(s), np.array(up))
            cell = WIDE * camera.fx / at[2]
            assert abs(float(end[0] / end[2] - at[0] / at[2])) / cell < 0.25
            flush += recess < 0.005
            compared += 1
    assert compared >= 12
    assert flush >= 3  # where frame and panel are one


def test_tops_and_handles_of_doors_in_the_walls_plane_have_their_heights(
    doors: list[tuple[Frame, WallView]],
) -> None:
    tops = 0
    for frame, view in doors:
        target, door = found_target(frame, view), frame.room.door
        assert door is not None
        if door.nuisance["opening"] != 0.0:
            continue
        depth = abs(door.nuisance["recess"]) + 0.08  # metres off the plane
        slack = HIGH + depth * 2.0 / view.frame.distance
        if np.isfinite(target.top):
            height = float(height_of(view, np.array(target.top)))
            truth = np.linalg.norm(door.corners["top_left"] - door.corners["bottom_left"])
            assert abs(height - truth) < slack
            tops += 1
        if door.handle_centre is None:
            assert target.kind == NO_HANDLE
        else:
            assert KINDS[int(target.kind)] == door.handle
            height = float(height_of(view, np.array(target.handle_row)))
            above = float(door.handle_centre @ view.frame.up) + view.frame.height
            assert abs(height - above) < slack
            nearer = abs(target.handle_column - target.left) < abs(
                target.handle_column - target.right
            )
            assert np.isnan(target.left + target.right) or nearer == (door.side == "left")
    assert tops >= 3


def test_a_plane_that_is_not_the_doors_shows_none(doors: list[tuple[Frame, WallView]]) -> None:
    frame, view = doors[0]
    behind = replace(view.frame, distance=view.frame.distance + 1.0)
    assert found_target(frame, replace(view, frame=behind)).door == 0.0
    wall = make_frame(0, "none", "wall")
    assert target_of(view, wall.room, wall.images, SETTINGS).door == 0.0


def test_a_mirrored_target_is_that_of_the_mirrored_view() -> None:
    target = Target(1.0, 10.0, 52.5, 11.0, 51.5, 12.0, 36.0, 48.0, 0.0)
    mirrored = target.mirrored(100)
    assert mirrored == Target(1.0, 46.5, 89.0, 47.5, 88.0, 12.0, 36.0, 51.0, 0.0)
    assert mirrored.mirrored(100) == target
    assert target.shifted(10.0) == Target(1.0, 0.0, 42.5, 1.0, 41.5, 12.0, 36.0, 38.0, 0.0)
