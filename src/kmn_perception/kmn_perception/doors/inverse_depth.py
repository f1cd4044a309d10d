"""Inverse depths on a grid of blocks: planes are linear in them, and their noise is even.

Along a ray r = (x, y, 1) of the optical frame a plane n . p = d has 1 / z = r . (n / d). A stereo
camera measures disparity, which is proportional to 1 / z, so that its noise does not grow with z.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from kmn_perception.doors.search_settings import PlaneSettings
from kmn_perception.model.camera import Camera

_SPANNED = 0.8  # of a ramp, from the 10th to the 90th percentile


@dataclass(frozen=True, eq=False)
class Blocks:
    """Medians of inverse depths over blocks of pixels.

    Attributes
    ----------
    rays
        (H, W, 3) of depth 1 through the blocks' middles, in the optical frame.
    inverse
        (H, W) inverse depths, 1/m; 0 where nothing is known.
    valid
        (H, W) blocks that were measured, and show one surface, also a slanted one.
    size
        Of a block, pixels.
    """

    rays: NDArray[np.float64]
    inverse: NDArray[np.float64]
    valid: NDArray[np.bool_]
    size: int

    @classmethod
    def of(
        cls, depth: NDArray[np.float32], camera: Camera, noise: float, settings: PlaneSettings
    ) -> Blocks:
        """Take the blocks of a depth image (height, width), metres, NaN where there is none.

        Parameters
        ----------
        noise
            Standard deviation of a block's inverse depth, 1/m.
        """
        size = settings.block
        least = max(1, int(np.ceil(settings.min_measured * size * size)))
        inverse, spread = _medians(depth, size, least)
        u = np.arange(inverse.shape[1]) * size + (size - 1) / 2.0
        v = np.arange(inverse.shape[0]) * size + (size - 1) / 2.0
        rays = camera.rays(*np.meshgrid(u, v))
        least_allowed = settings.max_spread * noise
        # Along rows, as walls are: what is steep along columns is mostly floor.
        ramp = _SPANNED * _ramp(inverse, settings.slanted)
        allowed = least_allowed + np.where(ramp > settings.steep * least_allowed, ramp, 0.0)
        return cls(rays, inverse, (inverse > 0.0) & (spread < allowed), size)

    def flat(self) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.bool_]]:
        """Return rays (N, 3), inverse depths and validity (N,), row by row."""
        return self.rays.reshape(-1, 3), self.inverse.reshape(-1), self.valid.reshape(-1)


def _medians(
    depth: NDArray[np.float32], size: int, least: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return median and spread (from the 10th to the 90th percentile) of 1 / z of each block."""
    rows, columns = depth.shape[0] // size, depth.shape[1] // size
    parts = depth[: rows * size, : columns * size].reshape(rows, size, columns, size)
    blocks = parts.swapaxes(1, 2).reshape(rows, columns, size * size)
    measured = blocks > 0.0  # neither none nor NaN
    z = np.sort(np.where(measured, blocks, np.float32(np.inf)), axis=2)
    count = measured.sum(axis=2)

    def inverse(rank: NDArray[np.int64]) -> NDArray[np.float64]:
        """Return the inverse depths (rows, columns) that so many of a block are below."""
        at = np.maximum(count - 1 - rank, 0)[..., None]
        return 1.0 / np.take_along_axis(z, at, axis=2)[..., 0].astype(np.float64)

    spread = inverse((9 * count) // 10) - inverse(count // 10)
    enough = count >= least
    return np.where(enough, inverse(count // 2), 0.0), np.where(enough, spread, 0.0)


def _ramp(inverse: NDArray[np.float64], reach: int) -> NDArray[np.float64]:
    """Return by how much a slanted surface changes over each block (H, W), along its row, 1/m.

    The least of the changes between the blocks up to a reach to either side if all have one sign,
    else 0 (minmod): an edge is steep between one or two of them only.
    """
    change = np.diff(inverse, axis=1)
    change[(inverse[:, 1:] == 0.0) | (inverse[:, :-1] == 0.0)] = 0.0
    change = np.pad(change, ((0, 0), (reach, reach)))
    about = np.lib.stride_tricks.sliding_window_view(change, 2 * reach, axis=1)
    least: NDArray[np.float64] = np.maximum(about.min(axis=2), -about.max(axis=2))
    return np.maximum(least, 0.0)
