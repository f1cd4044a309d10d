"""Which morphing parameters an image cannot show: the null space of what is seen."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from kmn_perception.model.camera import Camera
from kmn_perception.model.kinematic_model import KinematicModel

EMPTY = -1
DEPTH = 3
RAYS = 24  # to each face and edge that is visible; a few would suffice
STEP = 1e-3  # of finite differences, in half widths of the parameters
ROUNDING = 1e-9  # smaller entries of directions are 0
RANK_TOLERANCE = 1e-7  # singular values below it, relative to the largest, are rounding errors


class Measurements(NamedTuple):
    """Points on faces, each a smooth function of the parameters for a ray that is held fixed.

    Attributes
    ----------
    bodies, axes, sides
        (K,) the face: its unit cube, the axis of its normal, and +-0.5 along this axis.
    rays
        (K, 3) in the optical frame, with z = 1.
    coordinates
        (K,) the coordinate that is measured: 0 to 2 in the cube's frame where the ray meets an
        edge, or ``DEPTH``.
    """

    bodies: NDArray[np.int64]
    axes: NDArray[np.int64]
    sides: NDArray[np.float64]
    rays: NDArray[np.float64]
    coordinates: NDArray[np.int64]


def unobservable_directions(
    model: KinematicModel,
    camera: Camera,
    values: NDArray[np.float64],
    image: NDArray[np.float32],
) -> NDArray[np.float64]:
    """Return directions (k, n + m) in which (theta, gamma) changes nothing that a camera sees.

    A visible face shows its depth, an edge in front of something farther shows its position. Both
    are differentiated at fixed rays, where they are smooth, unlike the image itself. The directions
    are sparse: each has a parameter that the others lack.

    Parameters
    ----------
    values
        (n + m,) true parameters.
    image
        (height, width) their depth image in metres, NaN where there is nothing.
    """
    half_width = np.ptp(model.limits, axis=1) / 2.0
    cubes = _LinearCubes(model, camera)
    measured = _measurements(cubes(values), camera, np.isfinite(image))
    jacobian = _differentiate(lambda at: _measure(cubes(at), measured), values, STEP * half_width)
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


def _measure(camera_to_cubes: NDArray[np.float64], measured: Measurements) -> NDArray[np.float64]:
    """Return the coordinate (..., K) that each ray shows where it meets the plane of its face."""
    matrices = camera_to_cubes[..., measured.bodies, :3, :]
    slopes = (matrices[..., :3] @ measured.rays[:, :, None])[..., 0]
    origins = matrices[..., 3]
    every = np.arange(len(measured.rays))
    distances = measured.sides - origins[..., every, measured.axes]
    depths = distances / slopes[..., every, measured.axes]
    points = origins + depths[..., None] * slopes
    return np.concatenate((points, depths[..., None]), axis=-1)[..., every, measured.coordinates]


def _measurements(
    camera_to_cubes: NDArray[np.float64], camera: Camera, covered: NDArray[np.bool_]
) -> Measurements:
    """Find the faces and the edges that an image shows, and rays to each of them."""
    rays = _pixel_rays(camera)
    faces, depth = _raycast(covered, camera_to_cubes, rays, camera.near)
    inside = _spread(faces, 6 * len(camera_to_cubes), RAYS)
    edges = _thin(_edges(faces, depth, camera_to_cubes, rays), RAYS)
    face, edge, u, v = np.concatenate((inside, edges)).T
    face, coordinates = face.astype(np.int64), edge.astype(np.int64) // 2
    return Measurements(face // 6, face % 6 // 2, face % 2 - 0.5, camera.rays(u, v), coordinates)


@lru_cache(maxsize=1)
def _pixel_rays(camera: Camera) -> NDArray[np.float64]:
    """Return the rays (height, width, 3) of all pixels; an evaluation has one camera."""
    v, u = np.indices((camera.height, camera.width))
    return camera.rays(u, v)


def _thin(rows: NDArray[np.float64], max_count: int) -> NDArray[np.float64]:
    """Select up to ``max_count`` rows, evenly spread, of those with the same first two columns."""
    kind = 8 * rows[:, 0] + rows[:, 1]
    selected = []
    for number in np.unique(kind):
        same = np.flatnonzero(kind == number)
        selected.append(same[np.unique(np.linspace(0, len(same) - 1, max_count).astype(int))])
    return rows[np.concatenate(selected)] if selected else rows


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
def _raycast(
    covered: NDArray[np.bool_],
    camera_to_cubes: NDArray[np.float64],
    rays: NDArray[np.float64],
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
                    slope = row[0] * rays[v, u, 0] + row[1] * rays[v, u, 1] + row[2]
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
def _spread(faces: NDArray[np.int64], count: int, max_count: int) -> NDArray[np.float64]:
    """Return up to ``max_count`` pixels of each of ``count`` faces: face, 2 ``DEPTH``, u, v."""
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
                share = seen[face] * max_count // pixels[face]
                if share != (seen[face] - 1) * max_count // pixels[face]:
                    found.append((float(face), 2.0 * DEPTH, float(u), float(v)))
                seen[face] += 1
    return np.array(found)


@njit(cache=True, error_model="numpy")
def _edges(
    faces: NDArray[np.int64],
    depth: NDArray[np.float64],
    camera_to_cubes: NDArray[np.float64],
    rays: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return where edges are in front of something farther: face, 2 axis + side, and pixel u, v.

    They are found between neighbouring pixels that show different bodies, exact up to rounding.
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
                if depth[v, u] < depth[v + down, u + right]:
                    face, u0, v0, u1, v1 = here, u, v, u + right, v + down
                else:
                    face, u0, v0, u1, v1 = there, u + right, v + down, u, v
                ray = rays[v0, u0]
                edge, part = _crossing(
                    camera_to_cubes[face // 6], face % 6, ray, rays[v1, u1] - ray
                )
                if edge >= 0:
                    found.append(
                        (float(face), float(edge), u0 + part * (u1 - u0), v0 + part * (v1 - v0))
                    )
    return np.array(found).reshape(-1, 4)


@njit(cache=True, error_model="numpy")
def _crossing(
    camera_to_cube: NDArray[np.float64],
    face: int,
    ray: NDArray[np.float64],
    step: NDArray[np.float64],
) -> tuple[int, float]:
    """Return which edge of a face, 2 axis + side, a moving ray crosses first, and where.

    Parameters
    ----------
    ray, step
        (3,) a ray that meets the face, and by how much it moves, in the optical frame.

    Returns
    -------
    edge, part
        ``EMPTY`` if it crosses none, and the fraction of the step up to the crossing: there, the
        planes of the face and of the edge's other face are equally deep, and the difference of
        their depths, multiplied by both denominators, is linear in this fraction.
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
