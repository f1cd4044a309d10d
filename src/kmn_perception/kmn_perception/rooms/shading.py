"""The light that a camera sees of cuboids: lamps, shadows, textures, and soft edges."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from kmn_perception.model.rendering import meet_cube

Point = tuple[float, float, float]  # in the wall's frame, metres


class Scene(NamedTuple):
    """What is shaded, in the frame of a wall; metres.

    Attributes
    ----------
    to_cubes
        (B, 4, 4) maps of the optical frame to the unit cubes.
    normals
        (B, 3, 3) directions of each cube's axes.
    materials
        (B, 11) numbers of `Material` in their order.
    camera_to_wall
        (4, 4) pose of the camera.
    lights
        (L, 4) position and power of the lamps.
    ambient
        Light from all around.
    texture
        (n, n, n) samples of the solid texture, which repeats.
    shadows
        (s, s) depths that the first lamp sees.
    wall_to_map
        (3, 4) projection onto that map.
    softness
        Half width of shadows' edges, pixels of the map; 0: no shadows.
    bias
        Depth by which a shadow's cause must be nearer to the lamp.
    """

    to_cubes: NDArray[np.float64]
    normals: NDArray[np.float64]
    materials: NDArray[np.float64]
    camera_to_wall: NDArray[np.float64]
    lights: NDArray[np.float64]
    ambient: float
    texture: NDArray[np.float32]
    shadows: NDArray[np.float32]
    wall_to_map: NDArray[np.float64]
    softness: float
    bias: float


@njit(cache=True)
def shade_image(
    bodies: NDArray[np.int16],
    intrinsics: tuple[float, float, float, float],
    subsamples: int,
    scene: Scene,
) -> NDArray[np.float32]:
    """Return the light of every pixel; where bodies or faces meet, of the mean of finer rays."""
    height, width = bodies.shape
    fx, fy, cx, cy = intrinsics
    light = np.zeros((height, width), dtype=np.float32)
    faces = np.full((height, width), -1, dtype=np.int16)
    for v in range(height):
        for u in range(width):
            if bodies[v, u] >= 0:
                value, face = _shade(bodies[v, u], (u - cx) / fx, (v - cy) / fy, scene)
                light[v, u], faces[v, u] = value, 6 * bodies[v, u] + face
    smooth = light.copy()
    near = np.empty(9, dtype=np.int64)
    for v in range(1, height - 1):
        for u in range(1, width - 1):
            count, edge = 0, False
            for dv in range(-1, 2):
                for du in range(-1, 2):
                    edge |= faces[v + dv, u + du] != faces[v, u]
                    body = bodies[v + dv, u + du]
                    known = body < 0
                    for k in range(count):
                        known |= near[k] == body
                    if not known:
                        near[count] = body
                        count += 1
            if not edge:
                continue
            total = 0.0
            for j in range(subsamples):
                y = (v + (j + 0.5) / subsamples - 0.5 - cy) / fy
                for i in range(subsamples):
                    x = (u + (i + 0.5) / subsamples - 0.5 - cx) / fx
                    best, first = np.inf, -1
                    for k in range(count):
                        enter = meet_cube(scene.to_cubes[near[k]], x, y)
                        if enter < best:
                            best, first = enter, near[k]
                    if first >= 0:
                        total += _shade(first, x, y, scene)[0]
            smooth[v, u] = total / subsamples**2
    return smooth


@njit(cache=True)
def _shade(body: int, x: float, y: float, scene: Scene) -> tuple[float, int]:
    """Return the light that the ray (x, y, 1) brings from a body, and the face that it meets."""
    to_cube, pose = scene.to_cubes[body], scene.camera_to_wall
    depth = meet_cube(to_cube, x, y)
    axis, largest, sign = 0, -1.0, 1.0
    for k in range(3):
        local = (to_cube[k, 0] * x + to_cube[k, 1] * y + to_cube[k, 2]) * depth + to_cube[k, 3]
        if abs(local) > largest:
            axis, largest, sign = k, abs(local), np.sign(local)
    px = (pose[0, 0] * x + pose[0, 1] * y + pose[0, 2]) * depth + pose[0, 3]
    py = (pose[1, 0] * x + pose[1, 1] * y + pose[1, 2]) * depth + pose[1, 3]
    pz = (pose[2, 0] * x + pose[2, 1] * y + pose[2, 2]) * depth + pose[2, 3]
    point, normal = (px, py, pz), scene.normals[body, axis]
    light = scene.ambient * (0.75 + 0.25 * sign * normal[2])
    for k in range(len(scene.lights)):
        lamp = scene.lights[k]
        rx, ry, rz = lamp[0] - px, lamp[1] - py, lamp[2] - pz
        along = sign * (rx * normal[0] + ry * normal[1] + rz * normal[2])
        if along > 0.0:
            squared = rx * rx + ry * ry + rz * rz
            direct = lamp[3] * along / (squared * np.sqrt(squared))
            if k == 0 and scene.softness > 0.0:
                direct *= _lit(point, scene)
            light += direct
    face = 2 * axis + (1 if sign > 0.0 else 0)
    return light * _albedo(point, scene.materials[body], scene.texture), face


@njit(cache=True)
def _lit(point: Point, scene: Scene) -> float:
    """Return the fraction of the first lamp's light that reaches a point of the wall's frame."""
    shadows, to_map, softness = scene.shadows, scene.wall_to_map, scene.softness
    size, (x, y, z) = len(shadows), point
    seen = to_map[2, 0] * x + to_map[2, 1] * y + to_map[2, 2] * z + to_map[2, 3]
    if seen <= 0.0:
        return 1.0
    u = (to_map[0, 0] * x + to_map[0, 1] * y + to_map[0, 2] * z + to_map[0, 3]) / seen
    v = (to_map[1, 0] * x + to_map[1, 1] * y + to_map[1, 2] * z + to_map[1, 3]) / seen
    count = 0
    for j in range(-1, 2):
        line = int(np.rint(v + j * softness))
        for i in range(-1, 2):
            column = int(np.rint(u + i * softness))
            outside = not (0 <= column < size and 0 <= line < size)
            if outside or shadows[line, column] > seen - scene.bias:
                count += 1
    return count / 9.0


@njit(cache=True)
def _albedo(point: Point, material: NDArray[np.float64], texture: NDArray[np.float32]) -> float:
    """Return the fraction of light that a point of the wall's frame returns."""
    albedo, shift = material[0], material[5]
    if material[6] > 0.0:
        across = point[2] / material[7]
        row = np.floor(across)
        along = (point[0] + point[1]) / material[6] + material[8] * (row % 2.0) + shift
        beside = (along - np.floor(along)) * material[6]
        above = (across - row) * material[7]
        if beside < material[9] or above < material[9]:
            albedo *= material[10]
    if material[1] > 0.0:
        fine = _noise(point, material, shift, 1.0, texture)
        coarse = _noise(point, material, shift + 7.3, 0.2, texture)
        albedo *= 1.0 + material[1] * (fine + coarse)
    return min(max(albedo, 0.01), 1.0)


@njit(cache=True)
def _noise(
    point: Point,
    material: NDArray[np.float64],
    shift: float,
    scale: float,
    texture: NDArray[np.float32],
) -> float:
    """Return the solid texture at a point, between its samples linearly."""
    size = texture.shape[0]
    i, x0, x1 = _cell((point[0] * scale + shift) / material[2])
    j, y0, y1 = _cell((point[1] * scale + shift) / material[3])
    k, z0, z1 = _cell((point[2] * scale + shift) / material[4])
    i0, j0, k0 = i % size, j % size, k % size
    i1, j1, k1 = (i0 + 1) % size, (j0 + 1) % size, (k0 + 1) % size
    return (
        x0 * (y0 * (z0 * texture[i0, j0, k0] + z1 * texture[i0, j0, k1]))
        + x0 * (y1 * (z0 * texture[i0, j1, k0] + z1 * texture[i0, j1, k1]))
        + x1 * (y0 * (z0 * texture[i1, j0, k0] + z1 * texture[i1, j0, k1]))
        + x1 * (y1 * (z0 * texture[i1, j1, k0] + z1 * texture[i1, j1, k1]))
    )


@njit(cache=True)
def _cell(place: float) -> tuple[int, float, float]:
    """Return the sample below a place, and the weights of it and of the next one."""
    low = np.floor(place)
    return int(low), 1.0 - (place - low), place - low
