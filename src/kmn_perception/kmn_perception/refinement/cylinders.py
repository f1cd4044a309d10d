"""Cylinders as a camera sees them: their curved sides, limbs and rims.

A cylinder is the image of that which the unit cube holds, along one of the cube's axes. Its ends
are two of the cube's faces. A point P of homogeneous pixels is at X = R P - b in the unit cube;
with n the direction of X across the axis, the side is where n . X = 1/2. The limbs are the straight
lines along which rays touch the side. A rim's image is an ellipse, of which the silhouette shows an
arc; chords that enclose the same area stand for it.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from kmn_perception.refinement.solids import (
    AXIS,
    FACES_CAMERA,
    PLANES,
    SIDE,
    TO_UNIT,
    faces_camera,
)

SIDE_TERMS = 7  # by which the inverse depth of a side depends on the parameters, see `side_point`
MIN_OUTSIDE = 1e-9  # of the camera from the side, in diameters squared
MAX_CHORDS = 5  # of the arc of a rim
CHORD_ERROR = 0.1  # pixels by which an arc may leave its chords where fewer than those are enough
COARSE_LATERAL = 1.0  # pixels, where a search has no lateral noise: sides are seen at any slant


class SidePoint(NamedTuple):
    """Where a ray meets a cylinder, and the plane that is tangent to the side beside that point.

    Attributes
    ----------
    first, second
        Components of the direction n.
    along
        X along the axis.
    by_u, by_v, constant, offset
        The plane has the inverse depth ``(by_u u + by_v v + constant) / offset``.
    """

    first: float
    second: float
    along: float
    by_u: float
    by_v: float
    constant: float
    offset: float


@njit(cache=True, error_model="numpy")
def side_point(
    solids: NDArray[np.float64], body: int, u: float, v: float, inverse_depth: float
) -> SidePoint:
    """Return the point that a pixel shows of a cylinder, on its side or on an end."""
    axis = int(solids[body, AXIS])
    place, to_unit = np.empty(3), np.empty((3, 4))
    for k in range(3):
        for c in range(4):
            to_unit[k, c] = solids[body, TO_UNIT + 4 * k + c]
        ray = to_unit[k, 0] * u + to_unit[k, 1] * v + to_unit[k, 2]
        place[k] = ray / inverse_depth - to_unit[k, 3]
    i, j = (axis + 1) % 3, (axis + 2) % 3
    radius = math.hypot(place[i], place[j])
    first, second = (place[i] / radius, place[j] / radius) if radius > 0.0 else (1.0, 0.0)
    plane = first * to_unit[i] + second * to_unit[j]
    return SidePoint(
        first, second, place[axis], plane[0], plane[1], plane[2], 0.5 + plane[3]
    )  # fmt: skip


@njit(cache=True, error_model="numpy")
def side_deviation(point: SidePoint, depth_noise: float, lateral_noise: float) -> float:
    """Return the standard deviation of the inverse depth that is measured on a side, 1 / m."""
    lateral = lateral_noise if lateral_noise > 0.0 else COARSE_LATERAL
    slope = math.hypot(point.by_u, point.by_v) / point.offset
    return math.sqrt(depth_noise**2 + (lateral * slope) ** 2)


@njit(cache=True, error_model="numpy")
def side_terms(point: SidePoint, inverse_depth: float, terms: NDArray[np.float64]) -> None:
    """Fill in the terms (7,) which the side's Jacobian (7, P) maps to that of the inverse depth."""
    scale = -inverse_depth / point.offset
    first, second = scale * point.first, scale * point.second
    terms[0], terms[1] = 0.5 * first * point.first, 0.5 * first * point.second
    terms[2] = 0.5 * second * point.second
    terms[3], terms[4] = first * point.along, second * point.along
    terms[5], terms[6] = first, second


@njit(cache=True, error_model="numpy")
def at_border_of_cylinder(
    solids: NDArray[np.float64],
    lines: NDArray[np.float64],
    body: int,
    face: int,
    u: float,
    v: float,
    inverse_depth: float,
    border: float,
) -> bool:
    """Return whether a pixel lies within ``border`` pixels of the border of side or end it shows.

    Parameters
    ----------
    lines
        (12, 3) of the body, of which the first two are the limbs.
    """
    point = side_point(solids, body, u, v, inverse_depth)
    axis = int(solids[body, AXIS])
    if face == SIDE:
        for limb in range(2):
            if lines[limb, 0] * u + lines[limb, 1] * v + lines[limb, 2] < border:
                return True
    for end in range(2 * axis, 2 * axis + 2):
        if face != SIDE and face != end:
            continue
        k = PLANES + 3 * end
        by_u, by_v, constant = solids[body, k], solids[body, k + 1], solids[body, k + 2]
        apart = point.by_u * u + point.by_v * v + point.constant
        apart -= point.offset * (by_u * u + by_v * v + constant)
        steepness = math.hypot(point.by_u - point.offset * by_u, point.by_v - point.offset * by_v)
        if abs(apart) < border * steepness:
            return True
    return False


@njit(cache=True, error_model="numpy")
def see_side(
    solid: NDArray[np.float64],
    side_jacobian: NDArray[np.float64],
    axis: int,
    cube: NDArray[np.float64],
    jacobian: NDArray[np.float64],
) -> None:
    """Fill in a cylinder's map to the unit cube, the plane of its limbs and the side's Jacobian.

    Parameters
    ----------
    cube, jacobian
        (3, 4) and (3, 4, P) map of the unit cube to homogeneous pixels.
    """
    rows = np.empty((3, 3))
    for k in range(3):
        normal = np.cross(cube[:, (k + 1) % 3], cube[:, (k + 2) % 3])
        rows[k] = normal / (normal * cube[:, k]).sum()
        solid[TO_UNIT + 4 * k : TO_UNIT + 4 * k + 3] = rows[k]
        solid[TO_UNIT + 4 * k + 3] = (rows[k] * cube[:, 3]).sum()
    solid[AXIS] = axis
    i, j = (axis + 1) % 3, (axis + 2) % 3
    first, second = solid[TO_UNIT + 4 * i + 3], solid[TO_UNIT + 4 * j + 3]
    outside = first**2 + second**2 - 0.25
    solid[FACES_CAMERA + SIDE] = 1.0 if outside > MIN_OUTSIDE else 0.0
    if outside > MIN_OUTSIDE:
        k = PLANES + 3 * SIDE
        solid[k : k + 3] = (first * rows[i] + second * rows[j]) / outside
    for p in range(jacobian.shape[2]):
        for c in range(3):
            side_jacobian[0, p] += rows[i, c] * jacobian[c, i, p]
            side_jacobian[1, p] += rows[i, c] * jacobian[c, j, p] + rows[j, c] * jacobian[c, i, p]
            side_jacobian[2, p] += rows[j, c] * jacobian[c, j, p]
            side_jacobian[3, p] += rows[i, c] * jacobian[c, axis, p]
            side_jacobian[4, p] += rows[j, c] * jacobian[c, axis, p]
            side_jacobian[5, p] += rows[i, c] * jacobian[c, 3, p]
            side_jacobian[6, p] += rows[j, c] * jacobian[c, 3, p]


class Segment(NamedTuple):
    """A straight piece of a silhouette in the unit cube: its middle and its whole length (3,)."""

    middle: NDArray[np.float64]
    length: NDArray[np.float64]
    face: int


@njit(cache=True, error_model="numpy")
def silhouette_segments(
    solids: NDArray[np.float64], body: int, cube: NDArray[np.float64]
) -> list[tuple[int, Segment]]:
    """Return the silhouette of a cylinder, each piece with its number: limbs are the first two.

    Parameters
    ----------
    cube
        (3, 4) map of the unit cube to homogeneous pixels.
    """
    axis = int(solids[body, AXIS])
    found = [(0, Segment(np.zeros(3), np.zeros(3), 0)) for _ in range(0)]
    i, j = (axis + 1) % 3, (axis + 2) % 3
    first, second = solids[body, TO_UNIT + 4 * i + 3], solids[body, TO_UNIT + 4 * j + 3]
    towards = math.atan2(-second, -first)  # the camera, across the axis
    if not faces_camera(solids, body, SIDE):
        for end in range(2):
            if faces_camera(solids, body, 2 * axis + end):
                _add_arc(found, 0, cube, axis, end, 12, towards, math.pi)
        return found
    half = math.acos(0.5 / math.hypot(first, second))
    for limb in range(2):
        angle = towards + (2 * limb - 1) * half
        middle, length = np.zeros(3), np.zeros(3)
        middle[i], middle[j], length[axis] = 0.5 * math.cos(angle), 0.5 * math.sin(angle), 1.0
        found.append((limb, Segment(middle, length, SIDE)))
    for end in range(2):
        number = 2 + MAX_CHORDS * end
        if faces_camera(solids, body, 2 * axis + end):
            _add_arc(found, number, cube, axis, end, 0, towards + math.pi, math.pi - half)
        else:
            _add_arc(found, number, cube, axis, end, 0, towards, half)
    return found


@njit(cache=True, error_model="numpy")
def _add_arc(
    found: list[tuple[int, Segment]],
    number: int,
    cube: NDArray[np.float64],
    axis: int,
    end: int,
    chords: int,
    middle: float,
    half: float,
) -> None:
    """Add the chords of an arc of a rim.

    Parameters
    ----------
    number
        Of the first chord.
    chords
        How many there are; 0: as few as stay close to the arc, at most ``MAX_CHORDS``.
    middle, half
        Angle of the arc's middle, and half the angle that it spans.
    """
    i, j = (axis + 1) % 3, (axis + 2) % 3
    count = chords
    while chords == 0:
        count += 1
        error = _chord_error(cube, axis, end, middle - half + half / count, half / count)
        if count == MAX_CHORDS or error < CHORD_ERROR:
            break
    part = half / count
    for k in range(count):
        angle = middle - half + (2 * k + 1) * part
        cos, sin = math.cos(angle), math.sin(angle)
        place, length = np.zeros(3), np.zeros(3)
        place[axis] = end - 0.5
        mean = 0.5 * math.sin(part) / part
        place[i], place[j] = mean * cos, mean * sin
        length[i], length[j] = -math.sin(part) * sin, math.sin(part) * cos
        found.append((number + k, Segment(place, length, 2 * axis + end)))


@njit(cache=True, error_model="numpy")
def _chord_error(
    cube: NDArray[np.float64], axis: int, end: int, angle: float, part: float
) -> float:
    """Return how far the middle of an arc of half an angle lies from its chord, pixels."""
    i, j = (axis + 1) % 3, (axis + 2) % 3
    across = math.cos(angle) * cube[:, i] + math.sin(angle) * cube[:, j]
    along = -math.sin(angle) * cube[:, i] + math.cos(angle) * cube[:, j]
    place = cube[:, 3] + (end - 0.5) * cube[:, axis]
    line = np.cross(place + 0.5 * math.sin(part) / part * across, along)
    top = place + 0.5 * across
    return float(abs((line * top).sum() / (math.hypot(line[0], line[1]) * top[2])))
