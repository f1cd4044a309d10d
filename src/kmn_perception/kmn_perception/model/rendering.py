"""Exact depth images of a kinematic model by ray casting (the paper's ``render``)."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from kmn_perception.model.camera import Camera
from kmn_perception.model.parts import NO_AXIS


def render(
    unit_cubes: NDArray[np.float64], camera: Camera, axes: NDArray[np.int64] | None = None
) -> NDArray[np.float32]:
    """Cast a ray through the centre of every pixel onto affine images of cube and cylinder.

    Parameters
    ----------
    unit_cubes
        (B, 4, 4) maps of the unit cube [-0.5, 0.5]^3 to the world, as from
        ``KinematicModel.unit_cubes``.
    axes
        (B,) as ``KinematicModel.cylinder_axes``; without them, all bodies are cuboids.

    Returns
    -------
    depth
        (height, width) metres along the optical axis; NaN where there is nothing, or something
        nearer or farther than the camera measures.
    """
    return _render(unit_cubes, camera, None, axes)


def render_bodies(
    unit_cubes: NDArray[np.float64], camera: Camera
) -> tuple[NDArray[np.float32], NDArray[np.int16]]:
    """Cast rays as in `render`, and tell which cube each of them meets first.

    Returns
    -------
    depth
        (height, width) as of `render`.
    bodies
        (height, width) index of the cube; -1 where there is none.
    """
    bodies = np.full((camera.height, camera.width), -1, dtype=np.int16)
    return _render(unit_cubes, camera, bodies, None), bodies


def _render(
    unit_cubes: NDArray[np.float64],
    camera: Camera,
    bodies: NDArray[np.int16] | None,
    axes: NDArray[np.int64] | None,
) -> NDArray[np.float32]:
    depth = np.full((camera.height, camera.width), np.inf, dtype=np.float32)
    intrinsics = (camera.fx, camera.fy, camera.cx, camera.cy)
    for index, cube in enumerate(unit_cubes):
        cube_to_camera = camera.world_to_camera @ cube
        window = _window(cube_to_camera, camera)
        axis = NO_AXIS if axes is None else int(axes[index])
        _cast(depth, np.linalg.inv(cube_to_camera), *intrinsics, window, bodies, index, axis)
    depth[(depth < camera.near) | (depth > camera.far)] = np.nan
    return depth


def depth_to_points(depth: NDArray[np.float32], camera: Camera) -> NDArray[np.float32]:
    """Return the points (height, width, 3) of a depth image, in the optical frame, metres."""
    u = (np.arange(camera.width, dtype=np.float32) - np.float32(camera.cx)) / np.float32(camera.fx)
    v = (np.arange(camera.height, dtype=np.float32) - np.float32(camera.cy)) / np.float32(camera.fy)
    points = np.empty((*depth.shape, 3), dtype=np.float32)
    np.multiply(depth, u, out=points[..., 0])
    np.multiply(depth, v[:, None], out=points[..., 1])
    points[..., 2] = depth
    return points


def depth_to_cloud(depth: NDArray[np.float32], camera: Camera) -> NDArray[np.float32]:
    """Return the points (N, 3) of a depth image that there are, in the world frame, metres."""
    return _cloud(depth, camera.pose, camera.fx, camera.fy, camera.cx, camera.cy)


@njit(cache=True)
def _cloud(
    depth: NDArray[np.float32],
    pose: NDArray[np.float64],
    fx: float,
    fy: float,
    cx: float,
    cy: float,
) -> NDArray[np.float32]:
    height, width = depth.shape
    points = np.empty((height * width, 3), dtype=np.float32)
    count = 0
    for v in range(height):
        for u in range(width):
            z = depth[v, u]
            if not np.isnan(z):
                x, y = (u - cx) / fx * z, (v - cy) / fy * z
                for k in range(3):
                    points[count, k] = pose[k, 0] * x + pose[k, 1] * y + pose[k, 2] * z + pose[k, 3]
                count += 1
    return points[:count].copy()


def _window(cube_to_camera: NDArray[np.float64], camera: Camera) -> tuple[int, int, int, int]:
    """Return the part of the image (u0, u1, v0, v1) that can show the cube."""
    signs = np.array(np.meshgrid(*[[-0.5, 0.5]] * 3)).reshape(3, 8)
    corners = cube_to_camera[:3, :3] @ signs + cube_to_camera[:3, 3:]
    if corners[2].min() <= camera.near:
        return 0, camera.width, 0, camera.height
    u = corners[0] / corners[2] * camera.fx + camera.cx
    v = corners[1] / corners[2] * camera.fy + camera.cy
    return (
        max(0, int(np.floor(u.min()))),
        min(camera.width, int(np.ceil(u.max())) + 1),
        max(0, int(np.floor(v.min()))),
        min(camera.height, int(np.ceil(v.max())) + 1),
    )


@njit(cache=True)
def _cast(
    depth: NDArray[np.float32],
    camera_to_cube: NDArray[np.float64],
    fx: float,
    fy: float,
    cx: float,
    cy: float,
    window: tuple[int, int, int, int],
    bodies: NDArray[np.int16] | None,
    index: int,
    axis: int,
) -> None:
    """Lower ``depth`` to where the rays of the window enter the cube, or its cylinder."""
    u0, u1, v0, v1 = window
    for v in range(v0, v1):
        ray_y = (v - cy) / fy
        for u in range(u0, u1):
            if axis == NO_AXIS:
                enter = meet_cube(camera_to_cube, (u - cx) / fx, ray_y)
            else:
                enter = meet_cylinder(camera_to_cube, axis, (u - cx) / fx, ray_y)
            if enter < depth[v, u]:
                depth[v, u] = enter
                if bodies is not None:
                    bodies[v, u] = index


@njit(cache=True)
def meet_cube(camera_to_cube: NDArray[np.float64], ray_x: float, ray_y: float) -> float:
    """Return the depth at which the ray (x, y, 1) enters the unit cube (slab method).

    It is along the optical axis, metres, and infinite if the ray misses the cube.
    """
    enter, leave = 0.0, np.inf
    for axis in range(3):
        slope = (
            camera_to_cube[axis, 0] * ray_x
            + camera_to_cube[axis, 1] * ray_y
            + camera_to_cube[axis, 2]
        )
        start = camera_to_cube[axis, 3]
        if abs(slope) < 1e-12:
            if abs(start) > 0.5:
                leave = -1.0
            continue
        first, second = (-0.5 - start) / slope, (0.5 - start) / slope
        enter = max(enter, min(first, second))
        leave = min(leave, max(first, second))
    return enter if enter < leave else np.inf


@njit(cache=True)
def meet_cylinder(
    camera_to_cube: NDArray[np.float64], axis: int, ray_x: float, ray_y: float
) -> float:
    """Return the depth at which the ray (x, y, 1) enters the cylinder that the unit cube holds.

    It lies along an axis of the cube. See `meet_cube`.
    """
    square, product, rest = 0.0, 0.0, -0.25  # of the depth's polynomial: inside it is negative
    enter, leave = 0.0, np.inf
    for k in range(3):
        row = camera_to_cube[k]
        slope, start = row[0] * ray_x + row[1] * ray_y + row[2], row[3]
        if k != axis:
            square += slope * slope
            product += slope * start
            rest += start * start
        elif abs(slope) < 1e-12:
            if abs(start) > 0.5:
                return np.inf
        else:
            first, second = (-0.5 - start) / slope, (0.5 - start) / slope
            enter, leave = max(enter, min(first, second)), min(leave, max(first, second))
    discriminant = product * product - square * rest
    if discriminant <= 0.0:  # beside it, but for a ray along the axis
        return enter if rest < 0.0 and enter < leave else np.inf
    root = np.sqrt(discriminant)
    enter, leave = max(enter, (-product - root) / square), min(leave, (-product + root) / square)
    return enter if enter < leave else np.inf
