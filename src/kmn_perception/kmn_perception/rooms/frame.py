"""Frames of rendered rooms: what a depth camera with a grey image delivers of them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kmn_perception.model.camera import Camera
from kmn_perception.model.depth_sensor import DepthSensor
from kmn_perception.model.noisy_sensor import NoisySensor
from kmn_perception.rooms.rendering import Images, render_room
from kmn_perception.rooms.room import Room
from kmn_perception.rooms.sampling import sample_room
from kmn_perception.rooms.settings import RoomSettings

CALIBRATIONS = ("exact", "calibrated", "raw")


class Frame(NamedTuple):
    """A frame and the truth about it.

    Attributes
    ----------
    depth
        (height, width) as measured, metres, NaN for none.
    images
        Exact depth and the grey image.
    offset
        Error of the sensor's calibration: by this its inverse depth is too small, 1/m.
    """

    room: Room
    images: Images
    depth: NDArray[np.float32]
    offset: float


def make_frame(
    seed: int, sensor: str = "d455", kind: str = "door", calibration: str = "calibrated"
) -> Frame:
    """Return the frame of a seed.

    Parameters
    ----------
    sensor
        Name in ``config/sensors`` and ``config/cameras``; ``none``: the exact depth of a D455.
    kind
        One of ``KINDS`` of rooms.
    calibration
        One of ``CALIBRATIONS``.
    """
    settings = RoomSettings.load()
    camera = Camera.load("d455" if sensor == "none" else sensor)
    room = sample_room(seed, camera, settings, kind)
    images = render_room(room, settings.image, np.random.default_rng([seed, 1]))
    if sensor == "none":
        return Frame(room, images, images.depth, 0.0)
    description = DepthSensor.load(sensor)
    deviation = {"exact": 0.0, **description.calibration._asdict()}[calibration]
    offset = deviation * float(np.random.default_rng([seed, 2]).standard_normal())
    noisy = NoisySensor(description, (seed, 3), offset)
    return Frame(room, images, noisy.measure(images.depth, camera.fx), offset)
