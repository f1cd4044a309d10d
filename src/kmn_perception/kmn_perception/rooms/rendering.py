"""Depth and grey images of rooms: exact depth, and what a camera with soft edges would see."""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from kmn_perception.model.camera import Camera, look_at
from kmn_perception.model.rendering import render, render_bodies
from kmn_perception.rooms.room import Material, Room
from kmn_perception.rooms.settings import ImageSettings
from kmn_perception.rooms.shading import Scene, shade_image

VOLUME = 64  # samples of the solid texture along each axis, after which it repeats


class Images(NamedTuple):
    """What is rendered of a room.

    Attributes
    ----------
    depth
        (height, width) exact, metres; NaN where there is nothing, or glass.
    grey
        (height, width) with blur, noise and gamma.
    bodies
        (height, width) index of the cuboid that is seen; -1 where there is none.
    light
        (height, width) that reaches the camera: what `expose` makes another grey image of.
    """

    depth: NDArray[np.float32]
    grey: NDArray[np.uint8]
    bodies: NDArray[np.int16]
    light: NDArray[np.float32]


def render_room(room: Room, settings: ImageSettings, generator: np.random.Generator) -> Images:
    """Render a room as its camera sees it.

    Parameters
    ----------
    generator
        Of textures, exposure and noise of the image.
    """
    cubes = np.array([body.cube for body in room.cuboids])
    depth, bodies = render_bodies(cubes, room.camera)
    light = _radiance(room, cubes, bodies, settings, generator)
    grey = expose(light, settings, generator)
    lost = [k for k, body in enumerate(room.cuboids) if body.name in room.glass]
    depth[np.isin(bodies, lost)] = np.nan
    return Images(depth, grey, bodies, light)


def _radiance(
    room: Room,
    cubes: NDArray[np.float64],
    bodies: NDArray[np.int16],
    settings: ImageSettings,
    generator: np.random.Generator,
) -> NDArray[np.float32]:
    """Return the light (height, width) that reaches the camera."""
    camera = room.camera
    to_cubes = np.linalg.inv(camera.world_to_camera @ cubes).astype(np.float64)
    camera_to_wall = np.linalg.inv(room.wall) @ camera.pose
    cubes_to_wall = np.linalg.inv(room.wall) @ cubes
    normals = np.swapaxes(cubes_to_wall[:, :3, :3], 1, 2)
    normals = normals / np.linalg.norm(normals, axis=2, keepdims=True)
    texture = generator.standard_normal((VOLUME, VOLUME, VOLUME), dtype=np.float32)
    shadows, wall_to_map = _shadow_map(room, cubes, settings)
    scene = Scene(
        to_cubes,
        np.ascontiguousarray(normals),
        np.array([_row(body.material) for body in room.cuboids]),
        camera_to_wall,
        np.array([[*light.position, light.power] for light in room.lighting.lights]),
        room.lighting.ambient,
        texture,
        shadows,
        wall_to_map,
        room.lighting.softness,
        settings.shadow.bias,
    )
    intrinsics = (camera.fx, camera.fy, camera.cx, camera.cy)
    return shade_image(bodies, intrinsics, settings.subsamples, scene)


def _row(material: Material) -> list[float]:
    """Return a material as numbers, in their order."""
    return [
        material.albedo,
        material.contrast,
        *material.grain,
        material.shift,
        *material.tile,
        material.stagger,
        material.joint,
        material.joint_albedo,
    ]


def _shadow_map(
    room: Room, cubes: NDArray[np.float64], settings: ImageSettings
) -> tuple[NDArray[np.float32], NDArray[np.float64]]:
    """Return the depths that the first lamp sees, and the map (3, 4) of the wall's frame to it."""
    size, lighting = settings.shadow.size, room.lighting
    if lighting.softness == 0.0:
        return np.zeros((0, 0), dtype=np.float32), np.zeros((3, 4))
    focal, centre = size / 2.0 / np.tan(settings.shadow.field_of_view / 2.0), (size - 1) / 2.0
    lamp = room.wall[:3, :3] @ np.array(lighting.lights[0].position) + room.wall[:3, 3]
    target = room.wall[:3, 3] + np.array([0.0, 0.0, 1.0])
    camera = Camera(size, size, focal, focal, centre, centre, look_at(lamp, target))
    depth = render(cubes, camera)
    return np.nan_to_num(depth, nan=np.inf), camera.projection @ room.wall


def expose(
    light: NDArray[np.float32], settings: ImageSettings, generator: np.random.Generator
) -> NDArray[np.uint8]:
    """Return the image (height, width) of the light: exposure, blur, noise and gamma."""
    bright = generator.uniform(*settings.brightness)
    white = max(float(np.percentile(light[::4, ::4], settings.percentile)), 1e-6)
    blurred = cv2.GaussianBlur(light * np.float32(bright / white), (0, 0), settings.blur)
    if generator.random() < settings.moved:
        length, angle = generator.uniform(*settings.motion), generator.uniform(0.0, np.pi)
        blurred = cv2.filter2D(blurred, -1, _line(float(length), float(angle)))
    shot, read = settings.noise.shot, settings.noise.read
    sigma = np.sqrt(np.float32(shot**2) * blurred + np.float32(read**2))
    blurred = blurred + sigma * generator.standard_normal(blurred.shape, dtype=np.float32)
    values = np.clip(blurred, 0.0, 1.0) ** np.float32(1.0 / settings.gamma)
    return np.rint(255.0 * values).astype(np.uint8)


def _line(length: float, angle: float) -> NDArray[np.float32]:
    """Return the kernel of a motion along a line, pixels and rad."""
    reach = int(np.ceil(length / 2.0))
    kernel = np.zeros((2 * reach + 1, 2 * reach + 1), dtype=np.float32)
    steps = np.linspace(-length / 2.0, length / 2.0, 16 * reach + 1)
    columns, rows = (np.rint(reach + steps * f(angle)).astype(int) for f in (np.cos, np.sin))
    np.add.at(kernel, (rows, columns), 1.0)
    return kernel / kernel.sum()
