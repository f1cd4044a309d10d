"""The model as a camera sees it: its faces and silhouette, and how they move.

All that is seen is written in homogeneous pixels P = z (u, v, 1), which the camera matrix K makes
of the optical frame. A plane is a vector q with q . P = 1, so that its inverse depth at a pixel is
q . (u, v, 1), and the image of a straight edge is a line l with l . (u, v, 1) = 0.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from kmn_perception.refinement.geometry import Shape, cuboids

MIN_DEPTH = 1e-3  # metres in front of the camera; edges are cut off there
PLANES, VISIBLE, SOLID = 4, 22, 28  # where the planes and flags of a solid begin, and its length


class ModelView(NamedTuple):
    """The model as a camera sees it; P parameters, faces and edges numbered within each body.

    Face ``2 * axis`` is at -1/2 along the unit cube's axis, ``2 * axis + 1`` at +1/2.
    """

    solids: NDArray[np.float64]  # (B, SOLID) for ``raycast``: the bounds, then q of the faces, then
    # 1 for each face that looks at the camera
    plane_slopes: NDArray[np.float64]  # (B, 6, 3, P)
    lines: NDArray[np.float64]  # (B, 12, 3) l: distance to the edge in pixels, positive inside
    line_slopes: NDArray[np.float64]  # (B, 12, 3, P)
    ends: NDArray[np.float64]  # (B, 12, 4) u, v of both ends
    faces: NDArray[np.int64]  # (B, 12) the visible face at a silhouette edge, -1 at other edges


@njit(cache=True, error_model="numpy")
def model_view(
    shape: Shape, values: NDArray[np.float64], projected: NDArray[np.float64]
) -> ModelView:
    """Return the model at ``values`` as a camera of matrix ``projected`` (3, 4) sees it."""
    cubes, cube_slopes = cuboids(shape, values)
    bodies, count = cubes.shape[0], values.shape[0]
    view = ModelView(
        np.zeros((bodies, SOLID)),
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
def _see_faces(
    view: ModelView, b: int, cube: NDArray[np.float64], slopes: NDArray[np.float64]
) -> None:
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
            view.solids[b, VISIBLE + face] = 1.0 if (2 * side - 1) * offset < 0.0 else 0.0
            if abs(offset) < 1e-9:
                offset = 1e-9  # seen exactly from the side
            view.solids[b, PLANES + 3 * face : PLANES + 3 * face + 3] = row / offset
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
    view: ModelView,
    b: int,
    cube: NDArray[np.float64],
    slopes: NDArray[np.float64],
) -> None:
    """Fill in the body's silhouette: edges between a face that is seen and one that is not."""
    for edge in range(12):
        axis, first, second = edge // 4, (edge // 4 + 1) % 3, (edge // 4 + 2) % 3
        low, high = (edge // 2) % 2, edge % 2
        face, hidden = 2 * first + low, 2 * second + high
        if view.solids[b, VISIBLE + face] == view.solids[b, VISIBLE + hidden]:
            continue
        if view.solids[b, VISIBLE + hidden] > 0.0:
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
        cut = (MIN_DEPTH - start[2]) / direction[2]
        if direction[2] > 0.0:
            low = max(low, cut)
        else:
            high = min(high, cut)
    elif start[2] < MIN_DEPTH:
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
        if point[2] < MIN_DEPTH:
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
def raycast(solids: NDArray[np.float64], b: int, u: float, v: float) -> tuple[float, int]:
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
        k = PLANES + 3 * i
        inverse_depth = solids[b, k] * u + solids[b, k + 1] * v + solids[b, k + 2]
        if solids[b, VISIBLE + i] == 0.0:
            leave = max(leave, inverse_depth)
        elif inverse_depth < enter:
            enter, face = inverse_depth, i
    if face < 0 or enter <= leave:
        return 0.0, -1
    return enter, face


@njit(cache=True, error_model="numpy")
def raycast_any(solids: NDArray[np.float64], u: float, v: float) -> tuple[float, int, int]:
    """Return inverse depth, body and face where the ray of a pixel meets the model first."""
    nearest, body, face = 0.0, -1, -1
    for b in range(solids.shape[0]):
        inverse_depth, entered = raycast(solids, b, u, v)
        if inverse_depth > nearest:
            nearest, body, face = inverse_depth, b, entered
    return nearest, body, face
