"""Cuboids as a camera sees them, and how they move with the morphing parameters.

All that is seen is written in homogeneous pixels P = z (u, v, 1), which the camera matrix K makes
of the optical frame. A plane is a vector q with q . P = 1, so that its inverse depth at a pixel is
q . (u, v, 1), and the image of a straight edge is a line l with l . (u, v, 1) = 0.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from kmn_perception.camera import Camera
from kmn_perception.kinematic_model import KinematicModel
from kmn_perception.transformation import AXES, KINDS

TRANSLATION, ROTATION, SCALE = (KINDS.index(kind) for kind in ("translation", "rotation", "scale"))
LEAST_DEPTH = 1e-3  # metres in front of the camera; edges are cut off there


class Shape(NamedTuple):
    """A kinematic model for compiled loops: B bodies, n transformation parameters, m of gamma."""

    kinds: NDArray[np.int64]  # (n,) index into KINDS
    axes: NDArray[np.int64]  # (n,) index into AXES
    centre: NDArray[np.float64]  # (B, 3, 1 + m) constant and slopes
    size: NDArray[np.float64]  # (B, 3, 1 + m)


class View(NamedTuple):
    """The model as a camera sees it; P parameters, faces and edges numbered within each body.

    Face ``2 * axis`` is at -1/2 along the unit cube's axis, ``2 * axis + 1`` at +1/2.
    """

    solids: NDArray[np.float64]  # (B, 28) for ``meet``: the bounds, then q of the faces, then
    # 1 for each face that looks at the camera
    plane_slopes: NDArray[np.float64]  # (B, 6, 3, P)
    lines: NDArray[np.float64]  # (B, 12, 3) l: distance to the edge in pixels, positive inside
    line_slopes: NDArray[np.float64]  # (B, 12, 3, P)
    ends: NDArray[np.float64]  # (B, 12, 4) u, v of both ends
    faces: NDArray[np.int64]  # (B, 12) the visible face at a silhouette edge, -1 at other edges


def shape_of(model: KinematicModel) -> Shape:
    """Return the model's cuboids and transformation chain as arrays."""
    kinds = model.transformation.kinds
    return Shape(
        np.array([KINDS.index(kind) for kind, _ in kinds]),
        np.array([AXES.index(axis) for _, axis in kinds]),
        np.stack([np.c_[body.centre.constant, body.centre.slope] for body in model.bodies]),
        np.stack([np.c_[body.size.constant, body.size.slope] for body in model.bodies]),
    )


def unit_cubes_jacobian(model: KinematicModel, values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the derivative (B, 4, 4, n + m) of ``KinematicModel.unit_cubes`` at some values."""
    _, slopes = cuboids(shape_of(model), values)
    return np.concatenate([slopes, np.zeros_like(slopes[:, :1])], axis=1)


def projection(camera: Camera) -> NDArray[np.float64]:
    """Return the (3, 4) map from the world to homogeneous pixels z (u, v, 1)."""
    matrix = np.array([[camera.fx, 0, camera.cx], [0, camera.fy, camera.cy], [0, 0, 1.0]])
    return matrix @ camera.world_to_camera[:3]


@njit(cache=True, error_model="numpy")
def cuboids(
    shape: Shape, values: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the unit cubes' maps to the world (B, 3, 4) and their slopes (B, 3, 4, P)."""
    n, bodies = shape.kinds.shape[0], shape.centre.shape[0]
    yaw, translation, scale = 0.0, np.zeros(3), np.ones(3)
    for i in range(n):
        if shape.kinds[i] == TRANSLATION:
            translation[shape.axes[i]] = values[i]
        elif shape.kinds[i] == ROTATION:
            yaw = values[i]
        else:
            scale[shape.axes[i]] = 1.0 + values[i]
    cos, sin = np.cos(yaw), np.sin(yaw)
    rotation = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    turned = np.array([[-sin, -cos, 0.0], [cos, -sin, 0.0], [0.0, 0.0, 0.0]])
    cubes = np.zeros((bodies, 3, 4))
    slopes = np.zeros((bodies, 3, 4, values.shape[0]))
    for b in range(bodies):
        for axis in range(3):
            for column in (axis, 3):  # the size fills the diagonal, the centre the last column
                row = shape.centre[b, axis] if column == 3 else shape.size[b, axis]
                length = row[0]
                for j in range(row.shape[0] - 1):
                    length += row[1 + j] * values[n + j]
                for k in range(3):
                    along = rotation[k, axis] * scale[axis]
                    cubes[b, k, column] += along * length
                    for j in range(row.shape[0] - 1):
                        slopes[b, k, column, n + j] += along * row[1 + j]
                    for i in range(n):
                        if shape.kinds[i] == ROTATION:
                            slopes[b, k, column, i] += turned[k, axis] * scale[axis] * length
                        elif shape.kinds[i] == SCALE and shape.axes[i] == axis:
                            slopes[b, k, column, i] += rotation[k, axis] * length
        cubes[b, :, 3] += translation
        for i in range(n):
            if shape.kinds[i] == TRANSLATION:
                slopes[b, shape.axes[i], 3, i] += 1.0
    return cubes, slopes


@njit(cache=True, error_model="numpy")
def view_of(shape: Shape, values: NDArray[np.float64], projected: NDArray[np.float64]) -> View:
    """Return the model at ``values`` as a camera of matrix ``projected`` (3, 4) sees it."""
    cubes, cube_slopes = cuboids(shape, values)
    bodies, count = cubes.shape[0], values.shape[0]
    view = View(
        np.zeros((bodies, 28)),
        np.zeros((bodies, 6, 3, count)),
        np.zeros((bodies, 12, 3)),
        np.zeros((bodies, 12, 3, count)),
        np.zeros((bodies, 12, 4)),
        np.full((bodies, 12), -1),
    )
    for b in range(bodies):
        cube, slopes = np.zeros((3, 4)), np.zeros((3, 4, count))
        cube[:, 3] = projected[:, 3]
        for row in range(3):
            for k in range(3):
                cube[row] += projected[row, k] * cubes[b, k]
                slopes[row] += projected[row, k] * cube_slopes[b, k]
        _see_faces(view, b, cube, slopes)
        _see_edges(view, b, cube, slopes)
        _bound(view.solids[b], cube)
    return view


@njit(cache=True, error_model="numpy")
def _see_faces(view: View, b: int, cube: NDArray[np.float64], slopes: NDArray[np.float64]) -> None:
    """Fill in the planes of the body's faces, and which of them look at the camera."""
    inverse = np.empty((3, 3))
    for axis in range(3):
        across = np.cross(cube[:, (axis + 1) % 3], cube[:, (axis + 2) % 3])
        inverse[axis] = across / (across * cube[:, axis]).sum()
    for axis in range(3):
        row = inverse[axis]
        for side in range(2):
            offset = side - 0.5 + (row * cube[:, 3]).sum()
            face = 2 * axis + side
            view.solids[b, 22 + face] = 1.0 if (2 * side - 1) * offset < 0.0 else 0.0
            if abs(offset) < 1e-9:
                offset = 1e-9  # seen exactly from the side
            view.solids[b, 4 + 3 * face : 7 + 3 * face] = row / offset
            for i in range(slopes.shape[2]):
                row_slope = np.zeros(3)
                offset_slope = 0.0
                for k in range(3):
                    offset_slope += row[k] * slopes[k, 3, i]
                    for j in range(3):
                        product = row[k] * slopes[k, j, i]
                        for c in range(3):
                            row_slope[c] -= product * inverse[j, c]
                for c in range(3):
                    offset_slope += row_slope[c] * cube[c, 3]
                for c in range(3):
                    view.plane_slopes[b, face, c, i] = (
                        row_slope[c] - row[c] * offset_slope / offset
                    ) / offset


@njit(cache=True, error_model="numpy")
def _see_edges(
    view: View,
    b: int,
    cube: NDArray[np.float64],
    slopes: NDArray[np.float64],
) -> None:
    """Fill in the body's silhouette: edges between a face that is seen and one that is not."""
    for edge in range(12):
        axis, first, second = edge // 4, (edge // 4 + 1) % 3, (edge // 4 + 2) % 3
        low, high = (edge // 2) % 2, edge % 2
        face, hidden = 2 * first + low, 2 * second + high
        if view.solids[b, 22 + face] == view.solids[b, 22 + hidden]:
            continue
        if view.solids[b, 22 + hidden] > 0.0:
            face = hidden
        start = cube[:, 3] + (low - 0.5) * cube[:, first] + (high - 0.5) * cube[:, second]
        start_slope = (
            slopes[:, 3] + (low - 0.5) * slopes[:, first] + (high - 0.5) * slopes[:, second]
        )
        direction, direction_slope = cube[:, axis], slopes[:, axis]
        if not _ends(view.ends[b, edge], start, direction):
            continue
        line = np.cross(start, direction)
        length = np.hypot(line[0], line[1])
        inside = cube[:, 3] + (face % 2 - 0.5) * cube[:, face // 2]
        if (line * inside).sum() < 0.0:
            length = -length
        line /= length
        view.lines[b, edge] = line
        view.faces[b, edge] = face
        for i in range(slopes.shape[2]):
            slope = np.cross(start_slope[:, i], direction) + np.cross(start, direction_slope[:, i])
            slope /= length
            stretch = line[0] * slope[0] + line[1] * slope[1]
            view.line_slopes[b, edge, :, i] = slope - stretch * line


@njit(cache=True, error_model="numpy")
def _ends(
    ends: NDArray[np.float64], start: NDArray[np.float64], direction: NDArray[np.float64]
) -> bool:
    """Fill in where the part of an edge before the camera ends in the image, if there is any."""
    low, high = -0.5, 0.5
    if direction[2] != 0.0:
        cut = (LEAST_DEPTH - start[2]) / direction[2]
        if direction[2] > 0.0:
            low = max(low, cut)
        else:
            high = min(high, cut)
    elif start[2] < LEAST_DEPTH:
        return False
    if low >= high:
        return False
    for k in range(2):
        point = start + (low if k == 0 else high) * direction
        ends[2 * k] = point[0] / point[2]
        ends[2 * k + 1] = point[1] / point[2]
    return True


@njit(cache=True, error_model="numpy")
def _bound(bounds: NDArray[np.float64], cube: NDArray[np.float64]) -> None:
    """Fill in the rectangle of the image that holds the body."""
    bounds[0], bounds[1], bounds[2], bounds[3] = np.inf, -np.inf, np.inf, -np.inf
    for corner in range(8):
        point = cube[:, 3].copy()
        for axis in range(3):
            point += ((corner >> axis) % 2 - 0.5) * cube[:, axis]
        if point[2] < LEAST_DEPTH:
            bounds[0], bounds[1], bounds[2], bounds[3] = -np.inf, np.inf, -np.inf, np.inf
            return
        u, v = point[0] / point[2], point[1] / point[2]
        bounds[0], bounds[1] = min(bounds[0], u), max(bounds[1], u)
        bounds[2], bounds[3] = min(bounds[2], v), max(bounds[3], v)


@njit(cache=True, error_model="numpy")
def add_normal_equations(
    hessian: NDArray[np.float64],
    gradient: NDArray[np.float64],
    slopes: NDArray[np.float64],
    moment: NDArray[np.float64],
    force: NDArray[np.float64],
) -> None:
    """Add what a plane or a line of slopes (3, P) gets from its moments (3, 3) and force (3,)."""
    for i in range(slopes.shape[1]):
        for k in range(3):
            gradient[i] += slopes[k, i] * force[k]
            for c in range(3):
                for j in range(slopes.shape[1]):
                    hessian[i, j] += slopes[k, i] * moment[k, c] * slopes[c, j]


@njit(cache=True, error_model="numpy")
def meet(solids: NDArray[np.float64], b: int, u: float, v: float) -> tuple[float, int]:
    """Return the inverse depth and the face at which the ray of a pixel enters a body; 0, -1: none.

    The ray is within the body from the last plane of a visible face to the first of the others.

    Parameters
    ----------
    solids
        Of the view; compiled code is slow with tuples of arrays in its inner loops.
    """
    if u < solids[b, 0] or u > solids[b, 1] or v < solids[b, 2] or v > solids[b, 3]:
        return 0.0, -1
    enter, leave, face = np.inf, 0.0, -1
    for i in range(6):
        k = 4 + 3 * i
        inverse_depth = solids[b, k] * u + solids[b, k + 1] * v + solids[b, k + 2]
        if solids[b, 22 + i] == 0.0:
            leave = max(leave, inverse_depth)
        elif inverse_depth < enter:
            enter, face = inverse_depth, i
    if face < 0 or enter <= leave:
        return 0.0, -1
    return enter, face


@njit(cache=True, error_model="numpy")
def meet_any(solids: NDArray[np.float64], u: float, v: float) -> tuple[float, int, int]:
    """Return inverse depth, body and face where the ray of a pixel meets the model first."""
    nearest, body, face = 0.0, -1, -1
    for b in range(solids.shape[0]):
        inverse_depth, entered = meet(solids, b, u, v)
        if inverse_depth > nearest:
            nearest, body, face = inverse_depth, b, entered
    return nearest, body, face
