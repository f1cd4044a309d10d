"""Rendered rooms with a door of known place: what a camera before it sees."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kmn_perception.model.camera import Camera
from kmn_perception.model.room_model import RoomModel
from kmn_perception.rooms.building import Plan
from kmn_perception.rooms.design import Design, truth
from kmn_perception.rooms.draw import Draw
from kmn_perception.rooms.placing import attitude
from kmn_perception.rooms.rendering import render_room
from kmn_perception.rooms.room import Door, Light, Lighting, Material, Room
from kmn_perception.rooms.settings import RoomSettings

MODEL = RoomModel.load("room_door")
SETTINGS = RoomSettings.load()
MATERIALS = {
    "panel": Material(0.30, 0.02),
    "handle": Material(0.08, 0.02),
    "fitting": Material(0.08, 0.02),
    "wall": Material(0.75, 0.02),
    "post": Material(0.50, 0.02),
    "lintel": Material(0.50, 0.02),
    "seal": Material(0.05),
    "floor": Material(0.40, 0.05),
}
LIGHTS = Lighting((Light((-2.0, 0.7, 2.4), 3.0),), 0.4, 0.0)
UPSIDE_DOWN = np.diag([-1.0, -1.0, 1.0, 1.0])


class Seen(NamedTuple):
    """Depth (metres, NaN for none) and grey values (0 to 255) of a room, its camera and its door.

    The camera's pose and the door's parameters are those of the world.
    """

    depth: NDArray[np.float32]
    grey: NDArray[np.uint8]
    camera: Camera
    door: Door

    def upside_down(self) -> Seen:
        """Return what the camera sees when it is turned over."""
        width, height, camera = self.camera.width, self.camera.height, self.camera
        turned = replace(
            camera,
            cx=width - 1 - camera.cx,
            cy=height - 1 - camera.cy,
            pose=camera.pose @ UPSIDE_DOWN,
        )
        return Seen(self.depth[::-1, ::-1].copy(), self.grey[::-1, ::-1].copy(), turned, self.door)


def see_door(
    recess: float = 0.0,
    handle: str = "lever",
    side: str = "right",
    opening: float = 0.0,
    theta: tuple[float, float, float] = (-0.5, 0.05, 0.1),
    height: float = 1.3,
    tilt: float = -0.2,
    camera: Camera | None = None,
    frame_width: float = 0.06,
) -> Seen:
    """Render a door of 0.95 x 2.08 m in a wall, metres and radians.

    Parameters
    ----------
    theta
        x, y and yaw of the closed panel; the camera stands at x = -2.5 m and heads for x.
    height, tilt
        Of the camera above the floor, and of its optical axis above the horizon.
    camera
        Of which the intrinsics count; a D455 if there is none.
    """
    pose = attitude(tilt, 0.0)
    pose[:3, 3] = [-2.5, 0.0, height]
    placed = replace(camera or Camera.load("d455"), pose=pose)
    nuisance = {"recess": recess, "frame_width": frame_width, "frame_proud": 0.0}
    nuisance |= {"handle_length": 0.0, "opening": opening}
    values = np.array([*theta, 0.08, 0.15, 0.0, 0.0])
    fitting = "none" if handle == "none" else "rosette"
    design = Design(values, nuisance, handle, side, fitting)
    plan = Plan(Draw(0), design, MODEL, placed, SETTINGS)
    door = truth(design, MODEL, placed)
    bodies = tuple(plan.cuboids(MATERIALS))
    room = Room("door", bodies, plan.site.wall, LIGHTS, placed, door)
    images = render_room(room, SETTINGS.image, np.random.default_rng(0))
    return Seen(images.depth, images.grey, placed, door)


def answers_with_names(answer: Any) -> dict[str, float]:
    """Return the parameters of an answer by their names."""
    names = [*answer.theta_names, *answer.gamma_names]
    return dict(zip(names, [*answer.theta, *answer.gamma], strict=True))
