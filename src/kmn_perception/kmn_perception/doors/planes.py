"""Planes in a frame, found one after the other among blocks of inverse depths (RANSAC)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from kmn_perception.doors.inverse_depth import Blocks
from kmn_perception.doors.search_settings import PlaneSettings

_MIN_VOLUME = 1e-4  # of three rays; flatter ones tell no plane
_REFITS = 5


@dataclass(frozen=True, eq=False)
class Plane:
    """A plane seen from one side.

    Attributes
    ----------
    vector
        (3,) normal over distance, away from the camera: r . vector = 1 / z; 1/m, optical frame.
    blocks
        Number of blocks on it.
    """

    vector: NDArray[np.float64]
    blocks: int

    @property
    def normal(self) -> NDArray[np.float64]:
        """(3,) unit normal, towards the camera."""
        return -self.vector / np.linalg.norm(self.vector)

    @property
    def distance(self) -> float:
        """Of the camera from it, metres."""
        return float(1.0 / np.linalg.norm(self.vector))


def find_planes(
    blocks: Blocks, noise: float, settings: PlaneSettings, generator: np.random.Generator
) -> list[Plane]:
    """Find the planes that hold many blocks, the largest first or nearly so.

    Parameters
    ----------
    noise
        Standard deviation of a block's inverse depth, 1/m.
    """
    rays, inverse, valid = blocks.flat()
    free = valid.copy()
    needed = max(3.0, settings.min_share * valid.sum())
    planes: list[Plane] = []
    while len(planes) < settings.max_planes and free.sum() >= needed:
        found = _largest(blocks, free, noise, settings, generator)
        if found is None:
            break
        vector, on_it = found
        if on_it.sum() < needed:
            break
        planes.append(Plane(vector, int(on_it.sum())))
        free &= np.abs(rays @ vector - inverse) > (settings.inlier + 1.0) * noise
    return planes


def _largest(
    blocks: Blocks,
    free: NDArray[np.bool_],
    noise: float,
    settings: PlaneSettings,
    generator: np.random.Generator,
) -> tuple[NDArray[np.float64], NDArray[np.bool_]] | None:
    """Return the vector of the plane that most free blocks lie on, and which (N,) these are."""
    rays, inverse, _ = blocks.flat()
    triples = _triples(blocks, free, settings, generator)
    corners, values = rays[triples], inverse[triples]
    apart = np.abs(np.linalg.det(corners)) > _MIN_VOLUME
    if not apart.any():
        return None
    vectors = np.linalg.solve(corners[apart], values[apart, :, None])[..., 0]
    vector = vectors[_support(rays[free], inverse[free], vectors, settings.inlier * noise).argmax()]
    for _ in range(_REFITS):
        on_it = free & (np.abs(rays @ vector - inverse) < settings.inlier * noise)
        if on_it.sum() < 3:
            return None
        near = rays[on_it]
        vector = np.linalg.solve(near.T @ near, near.T @ inverse[on_it])
    return vector, on_it


@njit(cache=True)
def _support(
    rays: NDArray[np.float64],
    inverse: NDArray[np.float64],
    vectors: NDArray[np.float64],
    reach: float,
) -> NDArray[np.int64]:
    """Return how many blocks (N,) lie within reach of each of the planes (T, 3), 1/m."""
    counts = np.zeros(len(vectors), np.int64)
    x, y = rays[:, 0].copy(), rays[:, 1].copy()
    for t in range(len(vectors)):
        a, b, c = vectors[t]
        count = 0
        for i in range(len(inverse)):
            count += abs(a * x[i] + b * y[i] + c - inverse[i]) < reach
        counts[t] = count
    return counts


def _triples(
    blocks: Blocks,
    free: NDArray[np.bool_],
    settings: PlaneSettings,
    generator: np.random.Generator,
) -> NDArray[np.int64]:
    """Draw (T, 3) indices of free blocks on equilateral triangles about one of them."""
    height, width = blocks.valid.shape
    some = np.flatnonzero(free)
    middle = some[generator.integers(len(some), size=settings.trials)]
    low, high = (pixels / blocks.size for pixels in settings.patch)
    radius = generator.uniform(low, high, size=(settings.trials, 1))
    angle = generator.uniform(0.0, 2.0 * np.pi, size=(settings.trials, 1))
    angle = angle + np.arange(3) * (2.0 * np.pi / 3.0)
    rows = middle[:, None] // width + np.rint(radius * np.sin(angle)).astype(np.int64)
    columns = middle[:, None] % width + np.rint(radius * np.cos(angle)).astype(np.int64)
    inside = ((rows >= 0) & (rows < height) & (columns >= 0) & (columns < width)).all(axis=1)
    triples = rows[inside] * width + columns[inside]
    return triples[free[triples].all(axis=1)]
