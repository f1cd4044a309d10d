"""Blocks of inverse depths as they are seen about a wall, and what surfaces give there.

Seen from above, with x to the right and y away from the camera, a vertical plane is the line
b x + c y = 1, and a ray (x, y, up) sees the inverse depth b x + c y there. The floor at a height h
below gives -up / h.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kmn_perception.doors.inverse_depth import Blocks
from kmn_perception.doors.wall_view import WallFrame

WALL, PANEL, FLOOR, TILT, OFFSET, WARP = slice(0, 2), slice(2, 4), 4, slice(5, 7), 7, slice(7, 11)
FLOOR_OFFSET, SIZE = 11, 12
LOW, PANEL_HIGH = 0.1, 1.95  # metres above the floor between which any door's panel is


class PartSeen(NamedTuple):
    """Blocks that may lie on a surface.

    Attributes
    ----------
    part
        Of the values: which surface.
    rays
        (N, 3) in the wall's axes: to the right, away, up.
    rows
        (N, 12) derivatives of the inverse depths, but for those of the tilt.
    inverse
        (N,) inverse depths, 1/m.
    noise
        Standard deviation that the mean of a block has for its neighbours' errors, 1/m.
    """

    part: slice | int
    rays: NDArray[np.float64]
    rows: NDArray[np.float64]
    inverse: NDArray[np.float64]
    noise: float

    def derivatives(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the derivatives (N, 12) of the inverse depths at values (12,), until the next."""
        rows = self.rows  # not copied, since those of the tilt are set anew each time
        if isinstance(self.part, slice):
            rows[:, TILT] = -self.rays[:, 2:] * values[self.part]
        else:
            rows[:, TILT] = -values[self.part] * self.rays[:, :2]
        return rows


class SeenBlocks(NamedTuple):
    """All blocks of a frame, by where they would be on a wall.

    Attributes
    ----------
    rays
        (N, 3) of depth 1, in the optical frame.
    axes
        (N, 3) the same in the wall's: to the right, away, up.
    side, z
        (N,) metres to the right and above the floor on the wall; NaN of what looks away from it.
    inverse, valid
        (N,) inverse depths, 1/m, and whether they were measured.
    offset
        (N,) by how much these are larger than the wall's, 1/m.
    """

    rays: NDArray[np.float64]
    axes: NDArray[np.float64]
    side: NDArray[np.float64]
    z: NDArray[np.float64]
    inverse: NDArray[np.float64]
    valid: NDArray[np.bool_]
    offset: NDArray[np.float64]
    distance: float

    @classmethod
    def of(cls, blocks: Blocks, frame: WallFrame) -> SeenBlocks:
        """See the blocks of a frame about a wall."""
        rays, inverse, valid = blocks.flat()
        axes = rays @ np.stack([frame.right, -frame.normal, frame.up], axis=-1)
        away = np.where(axes[:, 1] > 0.0, axes[:, 1], np.nan)
        side = axes[:, 0] / away * frame.distance
        z = axes[:, 2] / away * frame.distance + frame.height
        offset = inverse - rays @ frame.vector
        return cls(rays, axes, side, z, inverse, valid, offset, frame.distance)

    def offset_at(self, depth: float) -> NDArray[np.float64]:
        """Return the offsets (N,) of a plane so many metres behind the wall, 1/m."""
        wall = self.inverse - self.offset
        return -wall * depth / (self.distance + depth)

    def between(self, edges: tuple[float, float], margin: float, high: float) -> NDArray[np.bool_]:
        """Return which blocks (N,) are between two edges, so many metres within, and below high.

        Parameters
        ----------
        edges
            Directions, metres to the right per metre away.
        """
        left, right = (edge * self.distance for edge in edges)
        beside = (self.side > left + margin) & (self.side < right - margin)
        return beside & (self.z > LOW) & (self.z < high)

    def part(self, part: slice | int, region: NDArray[np.bool_], noise: float) -> PartSeen:
        """Return the blocks of a region as those of a surface."""
        u, v = self.rays[region, 0], self.rays[region, 1]
        rows = np.zeros((len(u), SIZE))
        rows[:, WARP] = np.stack([np.ones_like(u), u, v, u * u], axis=-1)
        if isinstance(part, slice):
            rows[:, part] = self.axes[region, :2]
        else:
            rows[:, part] = -self.axes[region, 2]
            rows[:, FLOOR_OFFSET] = 1.0
        return PartSeen(part, self.axes[region], rows, self.inverse[region], noise)
