"""Which morphing parameters an image cannot show: the null space of what is seen."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from kmn_perception.model.camera import Camera
from kmn_perception.model.kinematic_model import KinematicModel

EMPTY = -1
DEPTH = 3
RAYS = 24  # to each face and edge that is seen; a few would do
STEP = 1e-3  # of finite differences, in half widths of the parameters
ROUNDING = 1e-9  # smaller entries of directions are 0
RANK_TOLERANCE = 1e-7  # singular values below it, relative to the largest, are rounding errors


class Seen(NamedTuple):
    """Points on faces, each a smooth function of the parameters for a ray that is held fixed.

    ``bodies``, ``axes`` (K,) and ``sides`` (K,) +-0.5 say on which face of which unit cube;
    ``rays`` (K, 3) in the optical frame with z = 1. ``shown`` (K,) is the coordinate that is seen:
    0 to 2 in the cube's frame, where the ray meets an edge, or ``DEPTH``.
    """

    bodies: NDArray[np.int64]
    axes: NDArray[np.int64]
    sides: NDArray[np.float64]
    rays: NDArray[np.float64]
    shown: NDArray[np.int64]


def null_directions(
    model: KinematicModel,
    camera: Camera,
    values: NDArray[np.float64],
    image: NDArray[np.float32],
) -> NDArray[np.float64]:
    """Return directions (k, n + m) in which (theta, gamma) changes nothing that a camera sees.

    A face that is seen shows its depth, an edge in front of something farther shows its place.
    Both are differentiated at fixed rays, where they are smooth, unlike the image itself. The
    directions are sparse: each has a parameter of its own.

    Parameters
    ----------
    values
        (n + m,) true parameters.
    image
        (height, width) their depth image, NaN where there is nothing.
    """
    half_width = np.ptp(model.limits, axis=1) / 2.0
    cubes = _LinearCubes(model, camera)
    seen = _see(cubes(values), camera, np.isfinite(image))
    jacobian = _differentiate(lambda at: _measure(cubes(at), seen), values, STEP * half_width)
    _, singular, rows = np.linalg.svd(jacobian)
    rank = int((singular > RANK_TOLERANCE * singular[0]).sum())
    return _sparse(rows[rank:]) * half_width


class _LinearCubes:
    """The maps from the optical frame to the unit cubes, of many (theta, gamma) at once."""

    def __init__(self, model: KinematicModel, camera: Camera) -> None:
        theta, gammas = np.zeros(len(model.theta)), np.eye(len(model.gamma))
        self._model, self._camera = model, camera
        self._constant = model.unit_cubes(theta, 0.0 * gammas.sum(axis=0))  # (B, 4, 4)
        self._slopes = [model.unit_cubes(theta, gamma) - self._constant for gamma in gammas]

    def __call__(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return maps (..., B, 4, 4) of parameters (..., n + m)."""
        theta, gamma = self._model.split(values)
        transforms = self._camera.world_to_camera @ self._model.transformation.matrix(theta)
        cubes = self._constant
        for i, slope in enumerate(self._slopes):
            cubes = cubes + gamma[..., i, None, None, None] * slope
        return np.linalg.inv(transforms[..., None, :, :] @ cubes).astype(np.float64)


def _differentiate(
    function: Callable[[NDArray[np.float64]], NDArray[np.float64]],
    at: NDArray[np.float64],
    steps: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return the derivatives (K, P), in units of P steps, by central differences of order 4."""
    moved = np.array([-2.0, -1.0, 1.0, 2.0])[:, None, None] * np.diag(steps)
    weights = np.array([1.0, -8.0, 8.0, -1.0]) / 12.0
    return np.asarray(np.tensordot(weights, function(at + moved), axes=1).T, dtype=np.float64)


def _measure(camera_to_cubes: NDArray[np.float64], seen: Seen) -> NDArray[np.float64]:
    """Return the coordinate (..., K) that each ray shows where it meets the plane of its face."""
    matrices = camera_to_cubes[..., seen.bodies, :3, :]
    slopes = (matrices[..., :3] @ seen.rays[:, :, None])[..., 0]
    origins = matrices[..., 3]
    every = np.arange(len(seen.rays))
    depths = (seen.sides - origins[..., every, seen.axes]) / slopes[..., every, seen.axes]
    places = origins + depths[..., None] * slopes
    return np.concatenate((places, depths[..., None]), axis=-1)[..., every, seen.shown]


def _see(camera_to_cubes: NDArray[np.float64], camera: Camera, covered: NDArray[np.bool_]) -> Seen:
    """Find the faces and the edges that an image shows, and rays to each of them."""
    intrinsics = (camera.fx, camera.fy, camera.cx, camera.cy)
    faces, depth = _cast(covered, camera_to_cubes, *intrinsics, camera.near)
    inside = _spread(faces, 6 * len(camera_to_cubes), RAYS)
    edges = _thin(_edges(faces, depth, camera_to_cubes, *intrinsics), RAYS)
    face, edge, u, v = np.concatenate((inside, edges)).T
    face, shown = face.astype(np.int64), edge.astype(np.int64) // 2
    rays = np.column_stack(
        ((u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, np.ones(len(u)))
    )
    return Seen(face // 6, face % 6 // 2, face % 2 - 0.5, rays, shown)


def _thin(rows: NDArray[np.float64], limit: int) -> NDArray[np.float64]:
    """Keep up to ``limit`` rows, evenly spread, of those that share their first two columns."""
    kind = 8 * rows[:, 0] + rows[:, 1]
    kept = []
    for number in np.unique(kind):
        same = np.flatnonzero(kind == number)
        kept.append(same[np.unique(np.linspace(0, len(same) - 1, limit).astype(int))])
    return rows[np.concatenate(kept)] if kept else rows


def _sparse(rows: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a basis of the span of rows in which each has an entry 1 that the others lack."""
    basis = rows.copy()
    for i in range(len(basis)):
        pivot = np.abs(basis[i]).argmax()
        basis[i] /= basis[i, pivot]
        others = np.arange(len(basis)) != i
        basis[others] -= np.outer(basis[others, pivot], basis[i])
    return np.where(np.abs(basis) < ROUNDING, 0.0, basis)


@njit(cache=True, error_model="numpy")
def _cast(
    covered: NDArray[np.bool_],
    camera_to_cubes: NDArray[np.float64],
    fx: float,
    fy: float,
    cx: float,
    cy: float,
    near: float,
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Return the face 6 body + 2 axis + side and the depth that the covered pixels show."""
    height, width = covered.shape
    faces = np.full((height, width), EMPTY, dtype=np.int64)
    depth = np.full((height, width), np.inf)
    for v in range(height):
        for u in range(width):
            if not covered[v, u]:
                continue
            for body in range(camera_to_cubes.shape[0]):
                enter, leave, face = near, np.inf, EMPTY
                for axis in range(3):
                    row = camera_to_cubes[body, axis]
                    slope = row[0] * (u - cx) / fx + row[1] * (v - cy) / fy + row[2]
                    side = 0 if slope > 0.0 else 1
                    first = (side - 0.5 - row[3]) / slope
                    leave = min(leave, (0.5 - side - row[3]) / slope)
                    if first > enter:
                        enter, face = first, 6 * body + 2 * axis + side
                    if enter >= leave:
                        break
                if enter < leave and enter < depth[v, u]:
                    faces[v, u], depth[v, u] = face, enter
    return faces, depth


@njit(cache=True)
def _spread(faces: NDArray[np.int64], count: int, limit: int) -> NDArray[np.float64]:
    """Return up to ``limit`` pixels of each face, evenly spread: face, 2 ``DEPTH``, u, v."""
    height, width = faces.shape
    pixels = np.zeros(count, dtype=np.int64)
    for face in faces.flat:
        if face != EMPTY:
            pixels[face] += 1
    seen = np.zeros(count, dtype=np.int64)
    found = []
    for v in range(height):
        for u in range(width):
            face = faces[v, u]
            if face != EMPTY:
                if seen[face] * limit // pixels[face] != (seen[face] - 1) * limit // pixels[face]:
                    found.append((float(face), 2.0 * DEPTH, float(u), float(v)))
                seen[face] += 1
    return np.array(found)


@njit(cache=True, error_model="numpy")
def _edges(
    faces: NDArray[np.int64],
    depth: NDArray[np.float64],
    camera_to_cubes: NDArray[np.float64],
    fx: float,
    fy: float,
    cx: float,
    cy: float,
) -> NDArray[np.float64]:
    """Return where edges lie in front of something farther: face, 2 axis + side, and pixel u, v.

    They are found between neighbours that show different bodies, exactly to rounding.
    """
    height, width = faces.shape
    found = [(0.0, 0.0, 0.0, 0.0) for _ in range(0)]
    for v in range(height):
        for u in range(width):
            for down, right in ((1, 0), (0, 1)):
                if v + down >= height or u + right >= width:
                    continue
                here, there = faces[v, u], faces[v + down, u + right]
                if here == there or here // 6 == there // 6:
                    continue
                nearer = depth[v, u] < depth[v + down, u + right]
                face, sign = (here, 1.0) if nearer else (there, -1.0)
                u0, v0 = (u, v) if nearer else (u + right, v + down)
                edge, part = _crossing(
                    camera_to_cubes[face // 6],
                    face % 6,
                    ((u0 - cx) / fx, (v0 - cy) / fy),
                    (sign * right / fx, sign * down / fy),
                )
                if edge >= 0:
                    found.append(
                        (
                            float(face),
                            float(edge),
                            u0 + part * sign * right,
                            v0 + part * sign * down,
                        )
                    )
    return np.array(found).reshape(-1, 4)


@njit(cache=True, error_model="numpy")
def _crossing(
    camera_to_cube: NDArray[np.float64],
    face: int,
    ray: tuple[float, float],
    step: tuple[float, float],
) -> tuple[int, float]:
    """Return which edge of a face, 2 axis + side, a ray meets first within a step, and where.

    Where the ray is a fraction of the step on, both the face's plane and that of the edge's other
    face are equally deep; the difference, freed of fractions, is linear in it.
    """
    axis, origin = face // 2, camera_to_cube[:, 3]
    slope = np.empty(3)
    change = np.empty(3)
    for i in range(3):
        row = camera_to_cube[i]
        slope[i] = row[0] * ray[0] + row[1] * ray[1] + row[2]
        change[i] = row[0] * step[0] + row[1] * step[1]
    to_face = face % 2 - 0.5 - origin[axis]
    found, first = EMPTY, 1.0
    for edge in range(6):
        across = edge // 2
        if across == axis:
            continue
        to_edge = edge % 2 - 0.5 - origin[across]
        here = to_face * slope[across] - to_edge * slope[axis]
        part = -here / (to_face * change[across] - to_edge * change[axis])
        if 0.0 <= part <= first:
            found, first = edge, part
    return found, first
