"""Objects that stand on others: models that stand on the support plane do not hold for them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from kmn_perception.scene.settings import StackingSettings

GRID = 6  # points along each side of a cuboid, by which its volume is sampled


def stands_on(
    points: NDArray[np.float32],
    cubes: NDArray[np.float64],
    others: NDArray[np.float64],
    settings: StackingSettings,
) -> bool:
    """Tell whether an object seems to reach down into another one, of which it is seen above.

    Parameters
    ----------
    points
        (N, 3) what is seen of the object, world frame, metres.
    cubes, others
        (B, 4, 4) bodies of the object and of the other one, see `KinematicModel.unit_cubes`.
    """
    for other in others:
        top = other[2, 3] + 0.5 * np.abs(other[2, :3]).sum()
        if points[:, 2].min() < top - settings.clear:
            continue
        if any(_share_inside(cube, other) > settings.overlap for cube in cubes):
            return True
    return False


def _share_inside(cube: NDArray[np.float64], other: NDArray[np.float64]) -> float:
    """Return which share of a cuboid lies in another one."""
    ticks = (np.arange(GRID) + 0.5) / GRID - 0.5
    grid = np.stack(np.meshgrid(ticks, ticks, ticks), axis=-1).reshape(-1, 3)
    points = grid @ cube[:3, :3].T + cube[:3, 3]
    inside = np.abs(np.linalg.solve(other[:3, :3], (points - other[:3, 3]).T)) <= 0.5
    return float(inside.all(axis=0).mean())
