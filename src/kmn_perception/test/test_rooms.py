"""Rendered rooms against geometry and photometry that are worked out apart from the renderer."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from kmn_perception.model.camera import Camera
from kmn_perception.model.room_model import RoomModel
from kmn_perception.rooms.design import draw_design
from kmn_perception.rooms.draw import Draw
from kmn_perception.rooms.frame import Frame, make_frame
from kmn_perception.rooms.label import label
from kmn_perception.rooms.render_rooms import main
from kmn_perception.rooms.rendering import render_room
from kmn_perception.rooms.room import Light, Lighting, Material, Room, cuboid
from kmn_perception.rooms.sampling import KINDS, sample_room
from kmn_perception.rooms.settings import RoomSettings

SETTINGS, CAMERA = RoomSettings.load(), Camera.load("d455")
PLAIN = SETTINGS.image._replace(
    gamma=1.0, moved=0.0, blur=0.1, percentile=100.0, brightness=(0.9, 0.9001),
    noise=SETTINGS.image.noise._replace(shot=0.0, read=0.0),
)  # fmt: skip
FACING = np.array([[0.0, 0, 1, 0], [-1, 0, 0, 0], [0, -1, 0, 0], [0, 0, 0, 1]])
LOOKING = Camera(320, 240, 200.0, 200.0, 159.5, 119.5, FACING)


@pytest.fixture(scope="module")
def frames() -> list[Frame]:
    return [make_frame(seed, "none") for seed in range(6)]


def nearest(room: Room, u: int, v: int) -> tuple[float, str]:
    """Return depth and body at a pixel: where its ray meets the planes of all faces."""
    camera, best = room.camera, (np.inf, "")
    direction = camera.pose[:3, :3] @ camera.rays(u, v)
    for body in room.cuboids:
        centre, axes = body.cube[:3, 3], body.cube[:3, :3]
        for k in range(3):
            normal = np.cross(axes[:, (k + 1) % 3], axes[:, (k + 2) % 3])
            for sign in (-0.5, 0.5):
                slope = normal @ direction
                if abs(slope) < 1e-12:
                    continue
                depth = normal @ (centre + sign * axes[:, k] - camera.position) / slope
                point = camera.position + depth * direction
                local = np.linalg.solve(axes, point - centre)
                if 0.0 < depth < best[0] - 1e-9 and np.abs(np.delete(local, k)).max() <= 0.5:
                    best = (float(depth), body.name)
    return best


def test_depth_is_that_of_the_nearest_face(frames: list[Frame]) -> None:
    generator = np.random.default_rng(0)
    for frame in frames:
        for _ in range(20):
            u, v = int(generator.integers(640)), int(generator.integers(480))
            depth, name = nearest(frame.room, u, v)
            if depth < CAMERA.near:
                assert np.isnan(frame.depth[v, u])
                continue
            assert frame.depth[v, u] == pytest.approx(depth, rel=1e-5)
            seen = frame.room.cuboids[frame.images.bodies[v, u]].name
            assert seen == name or frame.depth[v, u] == pytest.approx(depth, rel=1e-6)


def test_the_truth_lies_on_the_edges_of_the_rendered_panel(frames: list[Frame]) -> None:
    """Two pixels within the corners' lines is the panel or what hides it, and beyond it is not."""
    checked = 0
    for frame in frames:
        room, door = frame.room, frame.room.door
        assert door is not None
        names = np.array([body.name for body in room.cuboids])
        centre = np.mean(list(door.corners.values()), axis=0)
        for side in ("left", "right"):
            top, bottom = door.corners[f"top_{side}"], door.corners[f"bottom_{side}"]
            for share in np.linspace(0.05, 0.95, 40):
                edge = bottom + share * (top - bottom)
                outwards = (edge - centre) - (edge - centre) @ (top - bottom) * (top - bottom) / (
                    (top - bottom) @ (top - bottom)
                )
                step = 2.5 * edge[2] / CAMERA.fx * outwards / np.linalg.norm(outwards)
                for point, within in ((edge - 2 * step, True), (edge + 2 * step, False)):
                    u, v = (CAMERA.matrix @ point)[:2] / point[2]
                    if point[2] < 0.2 or not (0 <= u < 639 and 0 <= v < 479):
                        continue
                    at = (round(v), round(u))
                    hidden = frame.depth[at] < point[2] - 0.02
                    panel = names[frame.images.bodies[at]] in ("panel", "sign", "moulding", "hinge")
                    handle = names[frame.images.bodies[at]].startswith(("handle", "fitting"))
                    beyond = abs(frame.depth[at] - point[2]) > 0.005
                    assert (panel or handle or hidden) if within else (not panel or beyond)
                    checked += 1
    assert checked > 200


def wall_room(light: Lighting, *more: tuple) -> Room:
    """Return a grey wall at x = 2 before a camera at the origin, and more (low, high, albedo)."""
    bodies = [((2.0, -5.0, -5.0), (2.2, 5.0, 5.0), 0.5), *more]
    cuboids = tuple(
        cuboid(f"body_{k}", low, high, Material(albedo), np.eye(4))
        for k, (low, high, albedo) in enumerate(reversed(bodies))
    )
    return Room("wall", cuboids, np.eye(4), light, LOOKING, None)


def grey(room: Room) -> NDArray[np.float64]:
    """Return the light of every pixel, up to a factor."""
    image = render_room(room, PLAIN, np.random.default_rng(0)).grey
    assert image.max() > 200
    return image.astype(np.float64)


def test_light_follows_lambert_and_the_squared_distance() -> None:
    lamp = np.array([0.5, 0.4, 1.0])
    image = grey(wall_room(Lighting((Light(tuple(lamp), 1.0),), 0.0, 0.0)))
    v, u = np.mgrid[0:240:7, 0:320:7]
    points = 2.0 * LOOKING.rays(u, v) @ LOOKING.pose[:3, :3].T
    to_lamp = lamp - points
    expected = -to_lamp[..., 0] / np.linalg.norm(to_lamp, axis=-1) ** 3
    scale = np.median(image[v, u] / expected)
    np.testing.assert_allclose(image[v, u], scale * expected, rtol=0.005, atol=0.6)  # grey values


def test_an_edge_within_a_pixel_is_a_mixture() -> None:
    """A body of twice the albedo ends at a fraction of a pixel; one of three rays each way."""
    ambient = Lighting((Light((0.0, 0.0, 4.0), 1e-9),), 1.0, 0.0)
    for fraction in (0.2, 0.5, 0.8):
        column = 200 + fraction - 0.5  # the pixel 200 is covered by that fraction
        y = -(column - 159.5) / 200.0 * 1.99
        image = grey(wall_room(ambient, ((1.99, y, -5.0), (2.0, 5.0, 5.0), 1.0)))
        share = (image[120, 200] - image[120, 205]) / (image[120, 195] - image[120, 205])
        assert share == pytest.approx(fraction, abs=0.17)


def test_a_thing_before_the_lamp_casts_a_shadow() -> None:
    thing = ((1.0, 0.5, 0.5), (1.1, 1.0, 1.0), 0.5)  # above and left of the image's middle
    lamp = Light((0.2, 1.5, 1.5), 3.0)
    dark, lit = (
        grey(wall_room(Lighting((lamp,), 0.05, softness), thing)) for softness in (0.5, 0.0)
    )
    change = dark / lit
    # The line from the lamp through the thing's middle meets the wall at y = z = 0.1.
    start = np.array([0.2, 1.5, 1.5])
    along = np.array([1.05, 0.75, 0.75]) - start
    point = start + along * (2.0 - start[0]) / along[0]
    u, v = LOOKING.project(point)[:2]
    assert change[round(v), round(u)] < 0.3 * np.median(change)


def test_a_seed_gives_the_same_frame(frames: list[Frame]) -> None:
    again = make_frame(3, "none")
    np.testing.assert_array_equal(again.images.grey, frames[3].images.grey)
    np.testing.assert_array_equal(again.depth, frames[3].depth)
    assert (again.images.grey != frames[4].images.grey).any()


def test_doors_are_as_often_what_the_settings_say() -> None:
    model = RoomModel.load(SETTINGS.model)
    doors = [draw_design(Draw(seed), model, SETTINGS.door) for seed in range(1000)]
    recess = np.array([door.nuisance["recess"] for door in doors])
    opening = np.array([door.nuisance["opening"] for door in doors])
    assert np.mean(np.abs(recess) <= 0.005) == pytest.approx(0.5, abs=0.05)
    assert np.mean(opening == 0.0) == pytest.approx(0.7, abs=0.05)
    assert (recess[opening < 0.0] <= 0.005).all()
    assert np.mean([door.side == "left" for door in doors]) == pytest.approx(0.5, abs=0.05)
    for handle, share in SETTINGS.door.handle.items():
        assert np.mean([door.handle == handle for door in doors]) == pytest.approx(share, abs=0.05)
    values = np.array([door.values for door in doors])
    low, high = model.model.limits.T
    assert ((low <= values) & (values <= high)).all()
    heights = 1.0 + values[:, 3] / 2.0 + values[:, 6]
    low, high = SETTINGS.door.handle_height
    assert np.mean((low - 1e-9 <= heights) & (heights <= high + 1e-9)) > 0.95  # else the model's


def test_cameras_stand_where_the_settings_say() -> None:
    where, both = SETTINGS.camera, []
    for seed in range(60):
        room = sample_room(seed, CAMERA, SETTINGS)
        assert room.door is not None
        pose = np.linalg.inv(room.wall) @ room.camera.pose
        x, y, z = pose[:3, 3]
        assert where.distance[0] <= np.hypot(x, y) <= where.distance[1]
        assert where.aside[0] <= np.arctan2(y, -x) <= where.aside[1]
        assert where.height[0] <= z <= where.height[1]
        assert where.tilt[0] - 1e-9 <= np.arcsin(pose[2, 2]) <= where.tilt[1] + 1e-9
        assert abs(np.arcsin(pose[2, 0])) <= where.roll[1] + 1e-9
        u = [
            (CAMERA.matrix @ (0.5 * (top + bottom)))[0] / (0.5 * (top + bottom))[2]
            for top, bottom in (
                (room.door.corners[f"top_{side}"], room.door.corners[f"bottom_{side}"])
                for side in ("left", "right")
            )
        ]
        both.append(u[0] > -60 and u[1] < 700)
        assert u[0] < u[1]
    assert np.mean(both) > 0.8


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_of_room_is_rendered(kind: str) -> None:
    frame = make_frame(1, kind=kind)
    there = kind in ("door", "person", "one_edge", "no_floor", "wide_open")
    assert (frame.room.door is not None) == there
    assert np.isfinite(frame.depth).mean() > 0.3
    assert frame.images.grey.std() > 2.0
    written = label(frame, "name", {"kind": kind})
    assert ("reference" in written) == there
    if kind == "one_edge":
        edges = written["annotations"]["edges"]
        assert not (edges["left"]["visible"] and edges["right"]["visible"])


def test_behind_glass_nothing_is_measured() -> None:
    lost = []
    for seed in range(6):
        frame = make_frame(seed, "none", "glass")
        names = np.array([body.name for body in frame.room.cuboids])
        glass = names[frame.images.bodies] == "glass"
        assert np.isnan(frame.depth[glass]).all()
        lost.append(glass.mean())
    assert max(lost) > 0.05 > min(lost)


def test_depth_whose_calibration_is_off_is_named_as_delivered(tmp_path: Path) -> None:
    assert main(["--out", str(tmp_path), "--count", "1", "--calibration", "raw"]) == 0
    assert sorted(p.name for p in tmp_path.iterdir()) == [
        "door_0.json", "door_0_colour.jpg", "door_0_raw.png"
    ]  # fmt: skip


def test_the_program_writes_frames_with_labels(tmp_path: Path) -> None:
    assert main(["--out", str(tmp_path / "new"), "--count", "2", "--seed", "7"]) == 0
    written = json.loads((tmp_path / "new" / "door_7.json").read_text())
    depth = cv2.imread(str(tmp_path / "new" / "door_7_d.png"), cv2.IMREAD_UNCHANGED)
    image = cv2.imread(str(tmp_path / "new" / "door_8_colour.jpg"), cv2.IMREAD_UNCHANGED)
    assert depth is not None and image is not None
    assert depth.dtype == np.uint16 and depth.shape == image.shape == (480, 640)
    exact = make_frame(7, "none").depth
    both = (depth > 0) & np.isfinite(exact)
    assert np.median(np.abs(depth[both] / 1e3 / exact[both] - 1.0)) < 0.02
    metric = written["reference"]["metric"]
    world = np.array(metric["world"]["T_world_camera"])
    top, bottom = (np.array(metric["edges_3d"]["left"][end]) for end in ("top", "bottom"))
    assert world[2, :3] @ top + world[2, 3] == pytest.approx(metric["top_above_floor"]["value"])
    assert world[2, :3] @ bottom + world[2, 3] == pytest.approx(0.0, abs=1e-5)
    plane = metric["panel_plane"]
    normal = np.array(plane["normal_towards_camera"])
    assert normal @ top + plane["offset_m"] == pytest.approx(0.0, abs=1e-5)
    assert normal @ top < 0.0
    across = np.array(metric["edges_3d"]["right"]["top"]) - top
    np.testing.assert_allclose(across, np.array(metric["right"]) * metric["width"]["value"],
                               atol=1e-5)  # fmt: skip
