"""Doors in rendered rooms: what is found lies within what is stated, and none is invented."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import cv2
import numpy as np
import pytest

from kmn_perception.doors.door_estimate import DoorEstimate, DoorStatus
from kmn_perception.doors.walls import Frame
from kmn_perception.model.camera import Camera
from kmn_perception.rooms import frame as rooms
from kmn_perception.rooms.room import Room
from kmn_perception.rooms.sampling import sample_room
from kmn_perception.rooms.settings import RoomSettings

from .clear_rooms import CAMERA, as_seen, finder, render, settings

DEVIATIONS = 3.5  # within which every value must lie


def check(found: DoorEstimate, room: Room) -> None:
    """Check what is said of a door against its truth."""
    door = room.door
    assert door is not None
    truth = {
        "door_height": door.values[3],
        "door_width": door.values[4],
        "opening": door.nuisance["opening"],
        "recess": door.nuisance["recess"],
    }
    if found.hinge_is_known:
        assert found.latch_side == door.side
    if found.status is DoorStatus.OK:
        assert found.handle_side == door.side
        truth |= {"handle_y": door.values[5], "handle_z": door.values[6]}
    elif not found.hinge_is_known:  # nor is, then, which way it opens
        truth["opening"] = np.copysign(truth["opening"], found.value("opening"))
        truth.pop("recess") if truth["opening"] else None
    for name, value in truth.items():
        slack = DEVIATIONS * np.hypot(found.deviation(name), 0.003)
        assert abs(found.value(name) - value) < slack, (name, found.value(name), value, slack)
    normal = np.linalg.inv(room.camera.pose)[:3, :3] @ -door.frame[:3, 0]
    assert np.degrees(np.arccos(np.clip(found.normal @ normal, -1.0, 1.0))) < 3.0


CONDITIONS: dict[str, dict[str, Any]] = {
    "recessed": {},
    "flush": {"flush": 1.0},
    "in a frame": {"frame": 1.0},
    "flush in a frame": {"flush": 1.0, "frame": 1.0},
    "ajar": {"closed": 0.0, "ajar": (0.08, 0.26)},
    "knob": {"handle": {"knob": 1.0}},
    "lever on a plate": {"fitting": {"plate": 1.0}},
    "vertical bar": {"handle": {"bar": 1.0}},
    "no handle": {"handle": {"none": 1.0}},
    "wide ajar": {"closed": 0.0, "ajar": (0.3, 0.5)},
    "wide ajar, no handle": {"closed": 0.0, "ajar": (0.3, 0.5), "handle": {"none": 1.0}},
}


@pytest.mark.parametrize("condition", CONDITIONS)
def test_what_is_found_lies_within_what_is_stated(condition: str) -> None:
    found = []
    for seed in range(4):
        room = sample_room(seed, CAMERA, settings(**CONDITIONS[condition]), "door")
        estimate = finder().find(render(room, seed))
        if estimate.found:
            check(estimate, room)
            assert estimate.hinge_is_known or "wide" not in condition
        found.append(estimate.status)
    seen = (DoorStatus.OK, DoorStatus.HANDLE_NOT_SEEN)
    assert sum(status in seen for status in found) >= 2, found
    if "no handle" in condition:
        assert DoorStatus.OK not in found


def test_a_door_that_is_flush_is_not_seen_in_depth_alone() -> None:
    for seed in range(3):
        room = sample_room(seed, CAMERA, settings(flush=1.0), "door")
        estimate = finder().find(render(room, seed)._replace(grey=None))
        assert estimate.status is DoorStatus.NO_DOOR
        assert estimate.reason


def test_a_deep_recess_is_seen_in_depth_alone() -> None:
    shipped = RoomSettings.load().door.recess
    deep = shipped._replace(deep=(0.08, 0.15))
    found = []
    for seed in range(4):
        room = sample_room(seed, CAMERA, settings(recess=deep), "door")
        estimate = finder().find(render(room, seed)._replace(grey=None))
        if estimate.found:
            check(estimate, room)
        found.append(estimate.found)
    assert sum(found) >= 2


@pytest.mark.parametrize(
    "kind", ["wall", "brick", "cupboard", "window", "poster", "corridor", "glass", "double"]
)
def test_no_door_is_ok_where_there_is_none(kind: str) -> None:
    for seed in range(3):
        made = rooms.make_frame(seed, "d455", kind)
        estimate = finder().find(as_seen(made.depth, made.images.grey, made.room.camera))
        assert estimate.status is not DoorStatus.OK, seed


@pytest.mark.parametrize("kind", ["person", "one_edge", "no_floor", "wide_open"])
def test_what_is_hardly_seen_is_not_stated_firmly(kind: str) -> None:
    for seed in range(3):
        made = rooms.make_frame(seed, "d455", kind)
        estimate = finder().find(as_seen(made.depth, made.images.grey, made.room.camera))
        if estimate.found:
            check(estimate, made.room)


def test_the_mirror_image_of_a_frame_is_the_mirror_image_of_a_door() -> None:
    room = sample_room(1, CAMERA, settings(), "door")
    frame = render(room, 1)
    camera = room.camera
    assert frame.grey is not None
    flipped = Frame(
        np.ascontiguousarray(frame.depth[:, ::-1]),
        np.ascontiguousarray(frame.grey[:, ::-1]),
        Camera(
            camera.width, camera.height, camera.fx, camera.fy,
            camera.width - 1 - camera.cx, camera.cy, camera.pose,
        ),
    )  # fmt: skip
    one, other = finder().find(frame), finder().find(flipped)
    assert one.status is other.status is DoorStatus.OK
    assert {one.handle_side, other.handle_side} == {"left", "right"}
    for name in ("x", "door_width", "door_height", "handle_y", "handle_z", "recess"):
        slack = 2.0 * one.deviation(name)
        assert one.value(name) == pytest.approx(other.value(name), abs=slack), name
    for name in ("y", "yaw"):
        assert one.value(name) == pytest.approx(-other.value(name), abs=2.0 * one.deviation(name))


def test_a_candidate_whose_panel_would_be_seen_from_its_own_plane_is_left_out() -> None:
    """It would be hundreds of metres wide, more than can be looked at."""
    made = rooms.make_frame(910015)
    estimate = finder().find(as_seen(made.depth, made.images.grey, made.room.camera))
    assert estimate.status is DoorStatus.OK or estimate.reason


@pytest.mark.parametrize("axis", [0, 2])  # pitch and roll
def test_a_tilt_that_the_image_contradicts_is_refused(axis: int) -> None:
    room = sample_room(1, CAMERA, settings(), "door")
    frame = render(room, 1)
    up = room.camera.pose[2, :3]
    turn = cv2.Rodrigues(0.035 * np.eye(3)[axis])[0]  # by 2 degrees
    assert finder().find(frame._replace(up=up)).found
    refused = finder().find(frame._replace(up=turn @ up))
    assert refused.status is DoorStatus.NO_DOOR
    assert "vertical lines in the image are tilted by" in refused.reason


@pytest.mark.parametrize("turn", [-0.0175, 0.0175])
@pytest.mark.parametrize("seed", [1, 4])
def test_a_camera_that_is_pitched_by_a_degree_on_its_mount_sees_the_door_at_its_height(
    turn: float, seed: int
) -> None:
    """At the door's distance the pose that is given has it centimetres too high or too low."""
    room = sample_room(seed, CAMERA, settings(), "door")
    up, height = room.camera.pose[2, :3], float(room.camera.pose[2, 3])
    frame = render(room, seed)._replace(height=height)
    right = finder().find(frame._replace(up=up))
    found = finder().find(frame._replace(up=cv2.Rodrigues(turn * np.eye(3)[0])[0] @ up))
    assert right.found and found.found
    assert abs(found.value("door_height") - right.value("door_height")) < 0.008


def test_a_height_that_the_floor_contradicts_is_refused() -> None:
    room = sample_room(1, CAMERA, settings(), "door")
    frame = render(room, 1)._replace(up=room.camera.pose[2, :3])
    height = float(room.camera.pose[2, 3])
    assert finder().find(frame._replace(height=height)).found
    for wrong in (height - 0.1, height + 0.1):
        refused = finder().find(frame._replace(height=wrong))
        assert refused.status is DoorStatus.NO_DOOR
        assert f"by the pose that was given for it {wrong:.2f} m" in refused.reason


@pytest.mark.parametrize("turns", [1, 2, 3])
def test_a_pose_that_is_right_is_believed_however_the_camera_lies(turns: int) -> None:
    room = sample_room(1, CAMERA, settings(), "door")
    seen, up = render(room, 1), room.camera.pose[2, :3]
    for _ in range(turns):
        seen, up = quarter_turn(seen), np.array([up[1], -up[0], up[2]])
    found = finder().find(seen._replace(up=up))
    assert found.found, found.reason


def quarter_turn(frame: Frame) -> Frame:
    """Return what a camera sees that is turned clockwise: its image turns the other way."""
    assert frame.grey is not None
    camera = replace(
        frame.camera,
        width=frame.camera.height,
        height=frame.camera.width,
        fx=frame.camera.fy,
        fy=frame.camera.fx,
        cx=frame.camera.cy,
        cy=frame.camera.width - 1 - frame.camera.cx,
    )
    return frame._replace(
        depth=np.rot90(frame.depth).copy(), grey=np.rot90(frame.grey).copy(), camera=camera
    )


@pytest.mark.parametrize("short", [1e-9, 1e-6, 1e-5, 1e-4, 1e-3])
def test_a_wall_of_which_only_a_strip_is_near_enough_has_a_reason(short: float) -> None:
    """At the end of the reach a wall's view is a few columns wide, or none."""
    distance = finder().settings.view.reach - short
    depth = np.full((480, 640), distance, np.float32)
    found = finder().find(Frame(depth, np.full((480, 640), 0.5, np.float32), CAMERA))
    assert not found.found
    assert found.reason


def test_an_empty_frame_and_a_frame_without_walls_have_a_reason() -> None:
    nothing = Frame(np.zeros((480, 640), np.float32), None, CAMERA)
    assert finder().find(nothing).reason == "no plane is seen"
    rays = CAMERA.rays(*np.meshgrid(np.arange(640.0), np.arange(480.0)))
    up = np.array([0.0, -np.cos(0.9), -np.sin(0.9)])  # steeply down onto a floor
    floor = (1.0 / np.maximum(rays @ (-up / 1.5), 1e-3)).astype(np.float32)
    assert finder().find(Frame(floor, None, CAMERA)).reason == "no wall is seen"


@pytest.mark.parametrize("seed", range(4))
def test_whatever_a_frame_holds_has_an_answer(seed: int) -> None:
    """Random planes at any angle, noise, holes and stripes: an estimate or a reason, no error."""
    generator = np.random.default_rng(seed)
    rays = CAMERA.rays(*np.meshgrid(np.arange(640.0), np.arange(480.0)))
    for _ in range(3):
        vectors = generator.normal(0.0, 0.5, (generator.integers(1, 6), 3)) + [0.0, 0.0, 0.4]
        inverse = np.max(rays @ vectors.T, axis=-1) + generator.normal(0.0, 0.004, (480, 640))
        depth = np.where(inverse > 0.05, 1.0 / np.maximum(inverse, 0.05), 0.0)
        depth[generator.random((480, 640)) < generator.random() ** 2] = 0.0
        stripes = np.repeat(generator.random(40), 16)[None] + generator.normal(0, 0.02, (480, 640))
        for grey in (None, np.clip(stripes, 0.0, 1.0).astype(np.float32)):
            estimate = finder().find(Frame(depth.astype(np.float32), grey, CAMERA))
            assert estimate.status is DoorStatus.OK or estimate.reason
