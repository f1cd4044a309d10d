"""The bodies that a camera sees, packed for raycasts: compiled loops are slow with objects.

Each row of ``solids`` (B, SOLID) is a body: its bounding rectangle in the image (pixels), the
planes q of its faces with inverse depth q . (u, v, 1), and for each face whether it faces the
camera (1 or 0). A cuboid is the intersection of the half spaces behind these planes. Of a cylinder
two of the faces are its ends; the seventh is its side, whose plane is that of the two limbs, where
rays touch the side. Its row holds its axis, else `NO_AXIS`, and the map (3, 4) of homogeneous
pixels to the unit cube: X = R P - b.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from kmn_perception.model.parts import NO_AXIS

LEFT, RIGHT, TOP, BOTTOM, PLANES = range(5)  # the first column of each part of a row
SIDE, FACES = 6, 7
FACES_CAMERA = PLANES + FACES * 3
AXIS = FACES_CAMERA + FACES
TO_UNIT = AXIS + 1
SOLID = TO_UNIT + 12  # number of columns


@njit(cache=True, error_model="numpy")
def inverse_depth_at(
    solids: NDArray[np.float64], body: int, face: int, u: float, v: float
) -> float:
    """Return the inverse depth of a face's plane at a pixel, 1 / m."""
    k = PLANES + 3 * face
    return float(solids[body, k] * u + solids[body, k + 1] * v + solids[body, k + 2])


@njit(cache=True, error_model="numpy")
def gradient(solids: NDArray[np.float64], body: int, face: int) -> tuple[float, float]:
    """Return the derivatives of the inverse depth of a face's plane by u and v."""
    k = PLANES + 3 * face
    return solids[body, k], solids[body, k + 1]


@njit(cache=True, error_model="numpy")
def faces_camera(solids: NDArray[np.float64], body: int, face: int) -> bool:
    """Return whether a face is on the side of its body that the camera sees."""
    return bool(solids[body, FACES_CAMERA + face] > 0.0)


@njit(cache=True, error_model="numpy")
def raycast(solids: NDArray[np.float64], body: int, u: float, v: float) -> tuple[float, int]:
    """Return the inverse depth and the face where the ray of a pixel enters a body; 0, -1: nowhere.

    The ray is within the body from the last plane that faces the camera to the first that does not.
    """
    if (
        u < solids[body, LEFT]
        or u > solids[body, RIGHT]
        or v < solids[body, TOP]
        or v > solids[body, BOTTOM]
    ):
        return 0.0, -1
    if solids[body, AXIS] != NO_AXIS:
        return _raycast_cylinder(solids, body, u, v)
    enter, leave, entered = np.inf, 0.0, -1
    for face in range(6):
        inverse_depth = inverse_depth_at(solids, body, face, u, v)
        if not faces_camera(solids, body, face):
            leave = max(leave, inverse_depth)
        elif inverse_depth < enter:
            enter, entered = inverse_depth, face
    if entered < 0 or enter <= leave:
        return 0.0, -1
    return enter, entered


@njit(cache=True, error_model="numpy")
def _raycast_cylinder(
    solids: NDArray[np.float64], body: int, u: float, v: float
) -> tuple[float, int]:
    """Return what `raycast` does of a cylinder, between its ends and within its side.

    With X = a / w - b across the axis, the side is where ``|a - w b|^2 = w^2 / 4``.
    """
    axis = int(solids[body, AXIS])
    square, product, rest = -0.25, 0.0, 0.0
    for k in range(3):
        if k != axis:
            row = solids[body, TO_UNIT + 4 * k : TO_UNIT + 4 * k + 4]
            ray = row[0] * u + row[1] * v + row[2]
            square += row[3] * row[3]
            product += ray * row[3]
            rest += ray * ray
    discriminant = product * product - square * rest
    if discriminant < 0.0 or (square >= 0.0 and product <= 0.0):
        return 0.0, -1
    root = math.sqrt(discriminant)
    enter, leave, entered = np.inf, 0.0, -1
    if product + root > 0.0:  # else the ray is the axis
        leave = rest / (product + root)
    if faces_camera(solids, body, SIDE):
        enter, entered = (product + root) / square, SIDE
    for face in range(2 * axis, 2 * axis + 2):
        inverse_depth = inverse_depth_at(solids, body, face, u, v)
        if not faces_camera(solids, body, face):
            leave = max(leave, inverse_depth)
        elif inverse_depth < enter:
            enter, entered = inverse_depth, face
    if entered < 0 or enter <= leave:
        return 0.0, -1
    return enter, entered


@njit(cache=True, error_model="numpy")
def raycast_any(solids: NDArray[np.float64], u: float, v: float) -> tuple[float, int, int]:
    """Return the inverse depth, body and face where the ray of a pixel first enters the model."""
    nearest, entered, face = 0.0, -1, -1
    for body in range(solids.shape[0]):
        inverse_depth, entered_face = raycast(solids, body, u, v)
        if inverse_depth > nearest:
            nearest, entered, face = inverse_depth, body, entered_face
    return nearest, entered, face


@njit(cache=True, error_model="numpy")
def raycast_others(solids: NDArray[np.float64], body: int, u: float, v: float) -> float:
    """Return the inverse depth where the ray of a pixel first enters any other body; 0: nowhere."""
    nearest = 0.0
    for other in range(solids.shape[0]):
        if other != body:
            inverse_depth, _ = raycast(solids, other, u, v)
            nearest = max(nearest, inverse_depth)
    return nearest
