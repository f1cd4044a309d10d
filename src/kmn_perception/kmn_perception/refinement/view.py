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

from kmn_perception.model.parts import NO_AXIS
from kmn_perception.refinement.cylinders import SIDE_TERMS, see_side, silhouette_segments
from kmn_perception.refinement.geometry import Shape, cuboids
from kmn_perception.refinement.lines import MIN_DEPTH, ends_in_view, line_jacobian, touches
from kmn_perception.refinement.solids import (
    AXIS,
    BOTTOM,
    FACES_CAMERA,
    LEFT,
    PLANES,
    RIGHT,
    SOLID,
    TOP,
    faces_camera,
)

MIN_CREASE = 1e-9  # pixels; it is not 0, which stands for a step
MIN_OFFSET = 1e-9  # of the camera from a face's plane, in sizes of the body


class ModelView(NamedTuple):
    """The model as a camera sees it; P parameters, faces and edges numbered within each body.

    Face ``2 * axis`` is at -1/2 along the unit cube's axis, ``2 * axis + 1`` at +1/2. The edges of
    a cylinder are its limbs, the first two, and chords of its rims.

    Attributes
    ----------
    solids
        (B, SOLID) the bodies for raycasts, see `solids`.
    plane_jacobians
        (B, 6, 3, P) derivatives of the planes q.
    side_jacobians
        (B, 7, P) derivatives of the sides of cylinders, see `side_terms`.
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
    side_jacobians: NDArray[np.float64]
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
        np.zeros((bodies, SIDE_TERMS, parameters)),
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
        view.solids[body, AXIS] = NO_AXIS
        _see_faces(view, body, cube, jacobian)
        if shape.cylinders[body] != NO_AXIS:
            axis = shape.cylinders[body]
            see_side(view.solids[body], view.side_jacobians[body], axis, cube, jacobian)
            _see_outline(view, body, cube, jacobian)
        else:
            touching = np.zeros(12, dtype=np.bool_)
            for edge in range(12):
                touching[edge] = touches(cubes, shape.cylinders, body, edge, contact)
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
        if not ends_in_view(view.ends[body, edge], start, direction):
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
        line_jacobian(
            view.line_jacobians[body, edge],
            line,
            length,
            (start, direction),
            (start_jacobian, direction_jacobian),
        )


@njit(cache=True, error_model="numpy")
def _see_outline(
    view: ModelView, body: int, cube: NDArray[np.float64], jacobian: NDArray[np.float64]
) -> None:
    """Fill in the silhouette of a cylinder, all of which is fixed to it as far as it moves."""
    for edge, segment in silhouette_segments(view.solids, body, cube):
        start, direction = cube[:, 3].copy(), np.zeros(3)
        start_jacobian, direction_jacobian = jacobian[:, 3].copy(), np.zeros_like(jacobian[:, 3])
        for k in range(3):
            start += segment.middle[k] * cube[:, k]
            direction += segment.length[k] * cube[:, k]
            start_jacobian += segment.middle[k] * jacobian[:, k]
            direction_jacobian += segment.length[k] * jacobian[:, k]
        if not ends_in_view(view.ends[body, edge], start, direction):
            continue
        line = np.cross(start, direction)
        length = np.hypot(line[0], line[1])
        if (line * cube[:, 3]).sum() < 0.0:
            length = -length
        line /= length
        view.lines[body, edge] = line
        view.faces[body, edge] = segment.face
        line_jacobian(
            view.line_jacobians[body, edge],
            line,
            length,
            (start, direction),
            (start_jacobian, direction_jacobian),
        )


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
    """Add a plane, a line or a side with a Jacobian (K, P), given its moment (K, K) and force (K,).

    In loops: to compile products of matrices numba needs SciPy, which nodes do not have.
    """
    for i in range(jacobian.shape[1]):
        for k in range(jacobian.shape[0]):
            gradient[i] += jacobian[k, i] * force[k]
            for c in range(jacobian.shape[0]):
                for j in range(jacobian.shape[1]):
                    hessian[i, j] += jacobian[k, i] * moment[k, c] * jacobian[c, j]
