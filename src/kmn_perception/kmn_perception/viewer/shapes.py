"""Shapes of what is drawn: cuboids as triangles and edges, and extents that are uncertain."""

from __future__ import annotations

from collections.abc import Callable
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from kmn_perception.visualization.overlay import CUBE_CORNERS

STEP = 1e-5  # of parameters, for derivatives
_CORNERS = np.column_stack([CUBE_CORNERS, np.ones(8)])
_SIDES = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
_TRIANGLES = np.array([t for a, b, c, d in _SIDES for t in ((a, b, c), (a, c, d))])
_PAIRS = np.array(list(combinations(range(8), 2)))
_EDGES = _PAIRS[np.abs(np.diff(CUBE_CORNERS[_PAIRS], axis=1)).sum(axis=(1, 2)) == 1.0]

Cubes = NDArray[np.float64]


def corners(cubes: Cubes) -> NDArray[np.float64]:
    """Return the corners (B, 8, 3) of maps of the unit cube (B, 4, 4)."""
    placed: NDArray[np.float64] = _CORNERS @ cubes[:, :3].transpose(0, 2, 1)
    return placed


def triangles(cubes: Cubes) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return vertices (8 B, 3) and faces (12 B, 3) of cuboids (B, 4, 4)."""
    first = 8 * np.arange(len(cubes))[:, None, None]
    return corners(cubes).reshape(-1, 3), (_TRIANGLES + first).reshape(-1, 3)


def edges(cubes: Cubes) -> NDArray[np.float64]:
    """Return the edges (12 B, 2, 3) of cuboids (B, 4, 4)."""
    return corners(cubes)[:, _EDGES].reshape(-1, 2, 3)


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
