"""The model as a camera sees it: its faces and silhouette, and their derivatives.

All that is seen is written in homogeneous pixels P = z (u, v, 1), to which the camera matrix K maps
the optical frame. A plane is a vector q with q . P = 1, so that its inverse depth at a pixel is
q . (u, v, 1). The image of a straight edge is a line l with l . (u, v, 1) = 0.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from kmn_perception.refinement.geometry import Shape, cuboids
from kmn_perception.refinement.solids import (
    BOTTOM,
    FACES_CAMERA,
    LEFT,
    PLANES,
    RIGHT,
    SOLID,
    TOP,
    faces_camera,
)

MIN_DEPTH = 1e-3  # metres in front of the camera; edges are clipped there
MIN_CREASE = 1e-9  # pixels; it is not 0, which stands for a step
MIN_OFFSET = 1e-9  # of the camera from a face's plane, in sizes of the body


class ModelView(NamedTuple):
    """The model as a camera sees it; P parameters, faces and edges numbered within each body.

    Face ``2 * axis`` is at -1/2 along the unit cube's axis, ``2 * axis + 1`` at +1/2.

    Attributes
    ----------
    solids
        (B, SOLID) the bodies for raycasts, see `solids`.
    plane_jacobians
        (B, 6, 3, P) derivatives of the planes q.
    lines
        (B, 12, 3) l of the silhouette's edges: l . (u, v, 1) is the distance of a pixel to the
        edge, in pixels, positive inside.
    line_jacobians
        (B, 12, 3, P) derivatives of the lines.
    ends
        (B, 12, 4) u and v of both ends of each edge.
    faces
        (B, 12) the face beside each edge of the silhouette that the camera sees; -1 at edges that
        do not belong to the silhouette.
    creases
        (B, 12) where an edge touches another body, so that the depth has no step at it: half the
        width in pixels of the narrow face that ends there. The step is that over the whole face;
        line and ends are those of its middle, and the face is the one before it. Else 0.
    """

    solids: NDArray[np.float64]
    plane_jacobians: NDArray[np.float64]
    lines: NDArray[np.float64]
    line_jacobians: NDArray[np.float64]
    ends: NDArray[np.float64]
    faces: NDArray[np.int64]
    creases: NDArray[np.float64]


@njit(cache=True, error_model="numpy")
def model_view(
    shape: Shape,
    values: NDArray[np.float64],
    projection: NDArray[np.float64],
    contact: float,
    max_relief: float,
) -> ModelView:
    """Return the model at ``values`` (P,) as a camera with a projection (3, 4) sees it.

    Parameters
    ----------
    contact
        An edge this close to another body touches it, metres.
    max_relief
        An edge that touches another body is left out if the narrow face that ends there is deeper
        than this: along it the depth rises, and does not step.
    """
    cubes, cube_jacobians = cuboids(shape, values)
    bodies, parameters = cubes.shape[0], values.shape[0]
    view = ModelView(
        np.zeros((bodies, SOLID)),
        np.zeros((bodies, 6, 3, parameters)),
        np.zeros((bodies, 12, 3)),
        np.zeros((bodies, 12, 3, parameters)),
        np.zeros((bodies, 12, 4)),
        np.full((bodies, 12), -1),
        np.zeros((bodies, 12)),
    )
    for body in range(bodies):
        cube, jacobian = np.zeros((3, 4)), np.zeros((3, 4, parameters))
        cube[:, 3] = projection[:, 3]
        for row in range(3):
            for k in range(3):
                cube[row] += projection[row, k] * cubes[body, k]
                jacobian[row] += projection[row, k] * cube_jacobians[body, k]
        _see_faces(view, body, cube, jacobian)
        touching = np.zeros(12, dtype=np.bool_)
        for edge in range(12):
            touching[edge] = _touches(cubes, body, edge, contact)
        _see_edges(view, body, cube, jacobian, touching, max_relief)
        _bound(view.solids[body], cube)
    return view


@njit(cache=True, error_model="numpy")
def _see_faces(
    view: ModelView, body: int, cube: NDArray[np.float64], jacobian: NDArray[np.float64]
) -> None:
    """Fill in the planes of the body's faces, and which of them face the camera."""
    inverse = np.empty((3, 3))
    for axis in range(3):
        normal = np.cross(cube[:, (axis + 1) % 3], cube[:, (axis + 2) % 3])
        inverse[axis] = normal / (normal * cube[:, axis]).sum()
    for axis in range(3):
        row = inverse[axis]
        for side in range(2):
            offset = side - 0.5 + (row * cube[:, 3]).sum()
            face = 2 * axis + side
            if abs(offset) < MIN_OFFSET:  # a face in a plane with the camera does not face it
                offset = (2 * side - 1) * MIN_OFFSET
            view.solids[body, FACES_CAMERA + face] = 1.0 if (2 * side - 1) * offset < 0.0 else 0.0
            view.solids[body, PLANES + 3 * face : PLANES + 3 * face + 3] = row / offset
            for i in range(jacobian.shape[2]):
                row_derivative = np.zeros(3)
                offset_derivative = 0.0
                for k in range(3):
                    offset_derivative += row[k] * jacobian[k, 3, i]
                    for j in range(3):
                        product = row[k] * jacobian[k, j, i]
                        for c in range(3):
                            row_derivative[c] -= product * inverse[j, c]
                for c in range(3):
                    offset_derivative += row_derivative[c] * cube[c, 3]
                for c in range(3):
                    view.plane_jacobians[body, face, c, i] = (
                        row_derivative[c] - row[c] * offset_derivative / offset
                    ) / offset


@njit(cache=True, error_model="numpy")
def _see_edges(
    view: ModelView,
    body: int,
    cube: NDArray[np.float64],
    jacobian: NDArray[np.float64],
    touching: NDArray[np.bool_],
    max_relief: float,
) -> None:
    """Fill in the body's silhouette: edges between a face that is seen and one that is not."""
    for edge in range(12):
        axis, first, second = edge // 4, (edge // 4 + 1) % 3, (edge // 4 + 2) % 3
        at_first, at_second = (edge // 2) % 2 - 0.5, edge % 2 - 0.5
        face, hidden = 2 * first + (edge // 2) % 2, 2 * second + edge % 2
        if faces_camera(view.solids, body, face) == faces_camera(view.solids, body, hidden):
            continue
        if faces_camera(view.solids, body, hidden):
            face, hidden = hidden, face
        end = cube[:, 3] + at_first * cube[:, first] + at_second * cube[:, second]
        before = hidden ^ 1  # the face opposite to the hidden one
        crease = touching[edge] and faces_camera(view.solids, body, before)
        if crease and abs(cube[2, hidden // 2]) > max_relief:
            continue
        if crease:
            face = before
            if hidden // 2 == first:
                at_first = 0.0
            else:
                at_second = 0.0
        start = cube[:, 3] + at_first * cube[:, first] + at_second * cube[:, second]
        start_jacobian = (
            jacobian[:, 3] + at_first * jacobian[:, first] + at_second * jacobian[:, second]
        )
        direction, direction_jacobian = cube[:, axis], jacobian[:, axis]
        if not _ends(view.ends[body, edge], start, direction):
            continue
        line = np.cross(start, direction)
        length = np.hypot(line[0], line[1])
        inside = cube[:, 3] + (face % 2 - 0.5) * cube[:, face // 2]
        if (line * inside).sum() < 0.0:
            length = -length
        line /= length
        if crease:
            view.creases[body, edge] = max(abs((line * end).sum() / end[2]), MIN_CREASE)
        view.lines[body, edge] = line
        view.faces[body, edge] = face
        for i in range(jacobian.shape[2]):
            derivative = np.cross(start_jacobian[:, i], direction) + np.cross(
                start, direction_jacobian[:, i]
            )
            derivative /= length
            stretch = line[0] * derivative[0] + line[1] * derivative[1]
            view.line_jacobians[body, edge, :, i] = derivative - stretch * line


@njit(cache=True, error_model="numpy")
def _touches(cubes: NDArray[np.float64], body: int, edge: int, contact: float) -> bool:
    """Return whether the middle of an edge is in, or within ``contact`` metres of, another body."""
    axis = edge // 4
    middle = cubes[body, :, 3].copy()
    middle += ((edge // 2) % 2 - 0.5) * cubes[body, :, (axis + 1) % 3]
    middle += (edge % 2 - 0.5) * cubes[body, :, (axis + 2) % 3]
    for other in range(cubes.shape[0]):
        if other == body:
            continue
        outside = -np.inf
        for k in range(3):
            side = cubes[other, :, k]
            length = np.sqrt((side * side).sum())
            along = abs((side * (middle - cubes[other, :, 3])).sum()) / length
            outside = max(outside, along - 0.5 * length)
        if outside <= contact:
            return True
    return False


@njit(cache=True, error_model="numpy")
def _ends(
    ends: NDArray[np.float64], start: NDArray[np.float64], direction: NDArray[np.float64]
) -> bool:
    """Fill in the ends in the image of the part of an edge that is in front of the camera.

    Return whether there is such a part.
    """
    low, high = -0.5, 0.5
    if direction[2] != 0.0:
        crossing = (MIN_DEPTH - start[2]) / direction[2]
        if direction[2] > 0.0:
            low = max(low, crossing)
        else:
            high = min(high, crossing)
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
def _bound(solid: NDArray[np.float64], cube: NDArray[np.float64]) -> None:
    """Fill in the body's bounding rectangle in the image."""
    solid[LEFT], solid[RIGHT], solid[TOP], solid[BOTTOM] = np.inf, -np.inf, np.inf, -np.inf
    for corner in range(8):
        point = cube[:, 3].copy()
        for axis in range(3):
            point += ((corner >> axis) % 2 - 0.5) * cube[:, axis]
        if point[2] < MIN_DEPTH:
            solid[LEFT], solid[RIGHT], solid[TOP], solid[BOTTOM] = -np.inf, np.inf, -np.inf, np.inf
            return
        u, v = point[0] / point[2], point[1] / point[2]
        solid[LEFT], solid[RIGHT] = min(solid[LEFT], u), max(solid[RIGHT], u)
        solid[TOP], solid[BOTTOM] = min(solid[TOP], v), max(solid[BOTTOM], v)


@njit(cache=True, error_model="numpy")
def add_normal_equations(
    hessian: NDArray[np.float64],
    gradient: NDArray[np.float64],
    jacobian: NDArray[np.float64],
    moment: NDArray[np.float64],
    force: NDArray[np.float64],
) -> None:
    """Add a plane or a line with a Jacobian (3, P), given its own moment (3, 3) and force (3,)."""
    for i in range(jacobian.shape[1]):
        for k in range(3):
            gradient[i] += jacobian[k, i] * force[k]
            for c in range(3):
                for j in range(jacobian.shape[1]):
                    hessian[i, j] += jacobian[k, i] * moment[k, c] * jacobian[c, j]
