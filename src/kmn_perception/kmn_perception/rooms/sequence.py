"""Frames of one room that follow each other, seen by a camera that rests or moves."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from kmn_perception.model.camera import Camera
from kmn_perception.model.depth_sensor import DepthSensor
from kmn_perception.model.noisy_sensor import NoisySensor
from kmn_perception.rooms.frame import Frame
from kmn_perception.rooms.rendering import Images, expose, render_room
from kmn_perception.rooms.room import Room
from kmn_perception.rooms.sampling import sample_room
from kmn_perception.rooms.settings import ImageSettings, RoomSettings


def make_sequence(
    seed: int,
    count: int,
    step: float = 0.0,
    sensor: str = "d455",
    kind: str = "door",
    camera: Camera | None = None,
) -> Iterator[Frame]:
    """Yield frames of the room of a seed, whose noise is fresh in each.

    The calibration of the sensor and the exposure stay, as they do in a camera.

    Parameters
    ----------
    step
        Metres to the right that the camera moves from frame to frame; 0: it rests.
    sensor
        Name in ``config/sensors`` and ``config/cameras``.
    camera
        Another one than the sensor's, of other pixels.
    """
    settings, description = RoomSettings.load(), DepthSensor.load(sensor)
    room = sample_room(seed, camera or Camera.load(sensor), settings, kind)
    drawn = np.random.default_rng([seed, 2])
    offset = description.calibration.calibrated * float(drawn.standard_normal())
    bright = float(drawn.uniform(*settings.image.brightness))
    exposure = settings.image._replace(brightness=(bright, bright), moved=0.0)
    noisy, noise = NoisySensor(description, (seed, 3), offset), np.random.default_rng([seed, 4])
    images: Images | None = None
    for number in range(count):
        if images is None or step:
            room = _seen_beside(room, step if number else 0.0)
            images = _render(room, exposure, seed)
        grey = expose(images.light, exposure, noise)
        depth = noisy.measure(images.depth, room.camera.fx)
        yield Frame(room, images._replace(grey=grey), depth, offset)


def _seen_beside(room: Room, step: float) -> Room:
    """Return a room whose camera is so much farther to the right, metres."""
    camera, door = room.camera, room.door
    pose = camera.pose.copy()
    pose[:3, 3] += step * pose[:3, 0]
    shift = np.array([-step, 0.0, 0.0])  # of all that is told in the optical frame
    if door is not None:
        corners, opening = (
            {name: corner + shift for name, corner in found.items()}
            for found in (door.corners, door.opening)
        )
        handle = None if door.handle_centre is None else door.handle_centre + shift
        door = replace(door, corners=corners, opening=opening, handle_centre=handle)
    return replace(room, camera=replace(camera, pose=pose), door=door)


def _render(room: Room, settings: ImageSettings, seed: int) -> Images:
    """Return exact depth and light; the texture is that of the seed wherever the camera is."""
    return render_room(room, settings, np.random.default_rng([seed, 1]))
