"""Distances between the robot's surface and boxes, apart from the solver's own."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

REACH = 0.15  # metres; larger distances are of no interest


class Box(NamedTuple):
    """A box in a frame: centre and size (3,), metres."""

    frame: str
    centre: NDArray[np.float64]
    size: NDArray[np.float64]


class Surface(NamedTuple):
    """Points (P, 3) on a body's surface in its frame, and the sphere about them; metres."""

    frame: str
    points: NDArray[np.float64]
    centre: NDArray[np.float64]
    radius: float

    @classmethod
    def of(cls, frame: str, points: NDArray[np.float64]) -> Surface:
        """Make the surface of its points."""
        centre = (points.min(axis=0) + points.max(axis=0)) / 2.0
        radius = float(np.linalg.norm(points - centre, axis=1).max())
        return cls(frame, points, centre, radius)


def clearance(
    surface: Surface,
    relative: NDArray[np.float64],
    box: Box,
    reach: float = REACH,
) -> float:
    """Return the smallest distance between a surface and a box; negative where they overlap.

    Parameters
    ----------
    relative
        (N, 4, 4) poses of the surface's frame in the box's at N times.
    reach
        Up to which it is of interest, metres: what is further away is not measured.

    Returns
    -------
    distance
        Metres; ``reach`` if it is larger.
    """
    centres = relative[:, :3, :3] @ surface.centre + relative[:, :3, 3] - box.centre
    away = box_distance(centres, box.size)
    # Some point is nearer than the nearest sphere's far side: spheres beyond that do not matter.
    within = min(reach, away.min(initial=reach) + surface.radius)
    near = relative[away - surface.radius <= within]
    if not len(near):
        return reach
    points = surface.points @ near[:, :3, :3].transpose(0, 2, 1) + near[:, None, :3, 3]
    return min(reach, float(box_distance(points - box.centre, box.size).min()))


def box_distance(points: NDArray[np.float64], size: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the signed distances (...) of points (..., 3) to a box about the origin."""
    excess = np.abs(points) - size / 2.0
    outside = np.linalg.norm(np.maximum(excess, 0.0), axis=-1)
    return outside + np.minimum(excess.max(axis=-1), 0.0)


def sample_surface(
    vertices: NDArray[np.float64], triangles: NDArray[np.int64], spacing: float
) -> NDArray[np.float64]:
    """Return points (P, 3) that cover a triangle mesh.

    Parameters
    ----------
    vertices, triangles
        (V, 3) metres and (F, 3) numbers of vertices.
    spacing
        Largest distance between neighbouring points, metres.
    """
    corners = vertices[triangles]
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=-1).max(axis=1)
    parts = np.maximum(np.ceil(longest / spacing).astype(int), 1)
    points = [vertices]
    for count in np.unique(parts[parts > 1]):
        i, j = np.meshgrid(np.arange(count + 1), np.arange(count + 1))
        inside = i + j <= count
        weights = np.stack([i[inside], j[inside], count - i[inside] - j[inside]], axis=-1) / count
        points.append((weights @ corners[parts == count]).reshape(-1, 3))
    return thin(np.concatenate(points), spacing)


def thin(points: NDArray[np.float64], spacing: float) -> NDArray[np.float64]:
    """Keep one of the points (P, 3) in each cell of a grid."""
    cells = np.floor(points / spacing).astype(np.int64)
    return points[np.unique(cells, axis=0, return_index=True)[1]]
