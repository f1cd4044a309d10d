"""Where the camera stands before a door."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from kmn_perception.model.camera import Camera
from kmn_perception.model.room_model import RoomModel
from kmn_perception.rooms.design import EDGES, SAMPLES, Design, corners, inside
from kmn_perception.rooms.draw import Draw
from kmn_perception.rooms.settings import CameraSettings

TRIES = 2000

Acceptable = Callable[[Camera, Design], bool]


def place(
    draw: Draw,
    design: Design,
    model: RoomModel,
    camera: Camera,
    where: CameraSettings,
    acceptable: Acceptable,
) -> tuple[Design, Camera]:
    """Draw where the camera stands before the door.

    Parameters
    ----------
    camera
        Its pose does not matter.
    acceptable
        Whether a place will do.

    Returns
    -------
    design
        With theta: the world's origin is on the floor, and the camera stands above the place of the
        model's canonical camera and heads for x.
    camera
        With its pose.

    Raises
    ------
    RuntimeError
        If no such place is found.
    """
    low, high = model.model.limits.T
    for _ in range(TRIES):
        distance, aside = draw.between(where.distance), draw.between(where.aside)
        heading = draw.normal(where.heading) - aside  # in the wall's frame
        seen_from = distance * np.array([-np.cos(aside), np.sin(aside)])
        height = draw.between(where.height)
        tilt = np.arctan2(draw.between(where.aim) - height, distance)
        pose = attitude(float(np.clip(tilt, *where.tilt)), draw.between(where.roll))
        pose[:3, 3] = [model.model.camera.position[0], 0.0, height]
        values, (c, s) = design.values.copy(), (np.cos(heading), np.sin(heading))
        values[:2] = pose[:2, 3] - np.array([[c, s], [-s, c]]) @ seen_from
        values[2] = -heading
        placed, seen_by = design._replace(values=values), replace(camera, pose=pose)
        if ((low <= values) & (values <= high)).all() and acceptable(seen_by, placed):
            return placed, seen_by
    raise RuntimeError(f"no place for the camera was found in {TRIES} tries")


def edges_in_view(camera: Camera, design: Design, model: RoomModel, margin: float) -> int:
    """Return how many of the panel's vertical edges are in the image, at least a part of them."""
    found, steps = corners(design, model), np.linspace(0.0, 1.0, SAMPLES)[:, None]
    lines = (found[a] + steps * (found[b] - found[a]) for a, b in (EDGES["left"], EDGES["right"]))
    return sum(bool(inside(camera.project(line), camera, margin).any()) for line in lines)


def attitude(tilt: float, roll: float) -> NDArray[np.float64]:
    """Return the pose (4, 4) of an optical frame that heads for x.

    Parameters
    ----------
    tilt
        Angle of the optical axis above the horizon, rad.
    roll
        Angle of the turn about it, clockwise as the camera sees it, rad.
    """
    (ct, st), (cr, sr) = (np.cos(tilt), np.sin(tilt)), (np.cos(roll), np.sin(roll))
    forward, right = np.array([ct, 0.0, st]), np.array([0.0, -1.0, 0.0])
    down = np.cross(forward, right)
    pose = np.eye(4)
    pose[:3, 0], pose[:3, 1], pose[:3, 2] = cr * right + sr * down, cr * down - sr * right, forward
    return pose
