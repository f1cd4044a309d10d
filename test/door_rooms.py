"""Rendered rooms with a door of known place: what a camera before it sees."""

from __future__ import annotations

from dataclasses import replace
from itertools import count
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from sensor_msgs.msg import Image
from std_msgs.msg import Header

from kmn_msgs.msg import MorphingParameters
from kmn_perception.model.camera import Camera
from kmn_perception.model.room_model import RoomModel
from kmn_perception.model.rotation import quaternion_from_matrix
from kmn_perception.rooms.building import Plan
from kmn_perception.rooms.design import Design, truth
from kmn_perception.rooms.draw import Draw
from kmn_perception.rooms.placing import attitude
from kmn_perception.rooms.rendering import render_room
from kmn_perception.rooms.room import Door, Light, Lighting, Material, Room
from kmn_perception.rooms.settings import RoomSettings
from kmn_perception.ros.messages import image_from_depth, info_from_camera
from kmn_perception.ros.stamps import stamp_of

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
SECONDS = count(100, 10)  # of the frames; no image is near the depth of another one
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
    nuisance = {"recess": recess, "frame_width": 0.0, "frame_proud": 0.0}
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


class DoorTalk:
    """Publishes what a depth camera with an image sees to morph_node, and returns the answers."""

    def __init__(self, client: Any) -> None:
        self.client = client
        self.image = client.create_publisher(Image, "image", 10)
        client.graph.wait_for(self.image.get_subscription_count)

    def header(self) -> Header:
        """Return the header of the next frame, as of a camera."""
        made = Header(frame_id="camera_optical_frame")
        made.stamp.sec = next(SECONDS)
        return made

    def send_image(self, image: Image) -> None:
        """Publish an image, which is sure to have come before the depth that follows."""
        self.image.publish(image)
        self.image.wait_for_all_acked()

    def ask(
        self, seen: Seen, image: Image | None = None, header: Header | None = None
    ) -> MorphingParameters:
        """Publish an image, if there is one, and the depth; return the answer."""
        if image is not None:
            self.send_image(image)
        header = header or self.header()
        depth = image_from_depth(seen.depth.astype(np.float32), "32FC1", header)
        return self.client.ask_depth(depth, info_from_camera(seen.camera, header))

    def ask_grey(self, seen: Seen) -> MorphingParameters:
        """Publish depth and grey image of one moment; return the answer."""
        header = self.header()
        return self.ask(seen, image_from_grey(seen.grey, header), header)


def image_from_grey(
    grey: NDArray[np.uint8], header: Header, late: float = 0.0, encoding: str = "mono8"
) -> Image:
    """Make the message of pixels (height, width) or (height, width, 3) of a moment before."""
    stamp = stamp_of(header.stamp.sec - late)
    return Image(
        header=Header(stamp=stamp, frame_id=header.frame_id),
        height=grey.shape[0],
        width=grey.shape[1],
        encoding=encoding,
        step=grey.strides[0],
        data=grey.tobytes(),
    )


def given_pose(camera: Camera) -> dict[str, Any]:
    """Return the parameters of morph_node that tell where a camera stands."""
    return {
        "camera_pose": "given",
        "camera_position": camera.pose[:3, 3].tolist(),
        "camera_quaternion": quaternion_from_matrix(camera.pose[:3, :3]).tolist(),
    }


def assert_true(answer: MorphingParameters, door: Door, handle: bool = True) -> None:
    """Check all parameters of an answer against the truth, by the answer's own deviations."""
    number = 7 if handle else 5
    found = np.array([*answer.theta, *answer.gamma])[:number]
    deviations = np.sqrt(np.diag(np.reshape(answer.covariance, (7, 7))))[:number]
    assert (deviations > 0.0).all()
    assert deviations[:3].max() < 0.05  # neither does a large deviation excuse all
    np.testing.assert_array_less(np.abs(found - door.values[:number]) / deviations, 3.0)
