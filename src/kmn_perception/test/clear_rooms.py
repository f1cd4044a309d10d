"""Rendered rooms with doors that are easy to see, and the finder of doors."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np

from kmn_perception.doors.door_finder import DoorFinder
from kmn_perception.doors.walls import Frame
from kmn_perception.model.camera import Camera
from kmn_perception.model.depth_sensor import DepthSensor
from kmn_perception.model.noisy_sensor import NoisySensor
from kmn_perception.rooms.rendering import render_room
from kmn_perception.rooms.room import Room
from kmn_perception.rooms.settings import CameraSettings, RoomSettings

CAMERA = Camera.load("d455")


@cache
def finder() -> DoorFinder:
    return DoorFinder.load()


def settings(**door: Any) -> RoomSettings:
    """Return clear rooms, with a door as it is said, seen from where it is easy to see."""
    shipped = RoomSettings.load()
    where: CameraSettings = shipped.camera._replace(
        distance=(1.7, 2.3),
        aside=(-0.5, 0.5),
        height=(1.1, 1.5),
        roll=(-0.03, 0.03),
        both_edges=1.0,
    )
    plain: dict[str, Any] = {
        "closed": 1.0, "frame": 0.0, "flush": 0.0, "handle": {"lever": 1.0},
        "fitting": {"rosette": 1.0},
    }  # fmt: skip
    looks = shipped.looks._replace(alike=0.0, tiles=0.0)
    return shipped._replace(
        camera=where, looks=looks, door=shipped.door._replace(**{**plain, **door})
    )


def render(room: Room, seed: int) -> Frame:
    images = render_room(room, RoomSettings.load().image, np.random.default_rng([seed, 1]))
    sensor = NoisySensor(DepthSensor.load("d455"), (seed, 3), 0.0)
    return as_seen(sensor.measure(images.depth, CAMERA.fx), images.grey, room.camera)


def as_seen(depth: np.ndarray, grey: np.ndarray, camera: Camera) -> Frame:
    shade = grey.astype(np.float32) / np.float32(255.0)
    return Frame(np.nan_to_num(depth).astype(np.float32), shade, camera)
