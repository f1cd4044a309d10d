"""Shapes of what is drawn: bodies as triangles and edges, and extents that are uncertain."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kmn_perception.model.parts import NO_AXIS
from kmn_perception.visualization.overlay import CUBE_CORNERS, unit_circle

SIDES = 32  # of the prism that stands for a cylinder
STEP = 1e-5  # of parameters, for derivatives
_CORNERS = np.column_stack([CUBE_CORNERS, np.ones(8)])
_SIDES = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
_TRIANGLES = np.array([t for a, b, c, d in _SIDES for t in ((a, b, c), (a, c, d))])
_PAIRS = np.array(list(combinations(range(8), 2)))
_EDGES = _PAIRS[np.abs(np.diff(CUBE_CORNERS[_PAIRS], axis=1)).sum(axis=(1, 2)) == 1.0]

Cubes = NDArray[np.float64]
Axes = NDArray[np.int64]


def corners(cubes: Cubes) -> NDArray[np.float64]:
    """Return the corners (B, 8, 3) of maps of the unit cube (B, 4, 4)."""
    placed: NDArray[np.float64] = _CORNERS @ cubes[:, :3].transpose(0, 2, 1)
    return placed


def triangles(cubes: Cubes, axes: Axes) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return vertices (V, 3) and faces (F, 3) of cuboids (B, 4, 4), or cylinders along axes."""
    vertices = [np.empty((0, 3))]
    faces: list[NDArray[np.int64]] = [np.empty((0, 3), dtype=np.int64)]
    count = 0
    for cube, axis in zip(cubes, axes.tolist(), strict=True):
        mesh = _mesh(axis)
        vertices.append(mesh.vertices @ cube[:3, :3].T + cube[:3, 3])
        faces.append(mesh.faces + count)
        count += len(mesh.vertices)
    return np.concatenate(vertices), np.concatenate(faces)


def edges(cubes: Cubes, axes: Axes) -> NDArray[np.float64]:
    """Return the edges (E, 2, 3) of cuboids (B, 4, 4), or cylinders along axes (B,)."""
    meshes = [_mesh(axis) for axis in axes.tolist()]
    lines = [
        (mesh.vertices @ cube[:3, :3].T + cube[:3, 3])[mesh.edges]
        for cube, mesh in zip(cubes, meshes, strict=True)
    ]
    return np.concatenate([np.empty((0, 2, 3)), *lines])


class _Mesh(NamedTuple):
    """Vertices (V, 3) in the unit cube, faces (F, 3) and edges (E, 2) between them."""

    vertices: NDArray[np.float64]
    faces: NDArray[np.int64]
    edges: NDArray[np.int64]


@cache
def _mesh(axis: int) -> _Mesh:
    """Return the unit cube, or the cylinder along an axis in it: a prism with two middles."""
    if axis == NO_AXIS:
        return _Mesh(_CORNERS[:, :3], _TRIANGLES, _EDGES)
    rim = unit_circle(np.arange(SIDES) * 2.0 * np.pi / SIDES, axis).astype(np.float64)
    end = 0.5 * np.eye(3)[axis]
    low = np.arange(SIDES)
    following = (low + 1) % SIDES
    high, next_high = low + SIDES, following + SIDES
    middles = [np.full(SIDES, 2 * SIDES + k) for k in range(2)]
    faces = (
        (low, following, next_high),
        (low, next_high, high),
        (middles[0], following, low),
        (middles[1], high, next_high),
    )
    return _Mesh(
        np.concatenate([rim - end, rim + end, [-end, end]]),
        np.concatenate([np.column_stack(face) for face in faces]),
        np.concatenate([np.c_[low, following], np.c_[high, next_high]]),
    )


def uncertain_shapes(
    bodies: Callable[[NDArray[np.float64]], Cubes],
    values: NDArray[np.float64],
    covariance: NDArray[np.float64],
    limits: NDArray[np.float64],
    deviations: float,
    least: float,
) -> list[Cubes]:
    """Return how an object may look otherwise: for each uncertain direction both ends of it.

    The directions are those in which the corners of its bodies vary independently of each other
    (principal components of their covariance, to first order): parameters of metres, radians and
    scales are compared by what they move.

    Parameters
    ----------
    bodies
        Returns the cuboids (B, 4, 4) of parameters (p,).
    values, covariance, limits
        (p,), (p, p) and (p, 2) of the parameters; an end does not leave the limits.
    deviations
        How many standard deviations away an end is.
    least
        Directions in which no corner moves by as much are left out, metres.
    """
    if not np.isfinite(covariance).all():
        return []
    variances, axes = np.linalg.eigh(covariance)
    root = axes * np.sqrt(np.maximum(variances, 0.0))
    slopes = [
        (corners(bodies(values + step)) - corners(bodies(values - step))).ravel() / (2.0 * STEP)
        for step in STEP * np.eye(len(values))
    ]
    moves, sizes, mixed = np.linalg.svd(np.column_stack(slopes) @ root, full_matrices=False)
    low, high = np.minimum(limits[:, 0], values), np.maximum(limits[:, 1], values)
    shapes: list[Cubes] = []
    for move, size, mix in zip(moves.T, deviations * sizes, mixed, strict=True):
        if size * np.linalg.norm(move.reshape(-1, 3), axis=1).max() >= least:
            change = deviations * root @ mix
            shapes += [bodies(np.clip(values + sign * change, low, high)) for sign in (1.0, -1.0)]
    return shapes
