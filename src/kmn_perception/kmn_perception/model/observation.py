"""What a sensor saw of an object, and of the space around it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kmn_perception.model.camera import Camera
from kmn_perception.model.point_rendering import inverse_depth_of_points


class FreeSpace(NamedTuple):
    """What a sensor saw in the pixels (height, width) that show no point of an object.

    Attributes
    ----------
    free_depth
        Depth in metres up to which a pixel was seen to be empty: infinite for all of its line of
        sight, 0 where nothing is known. Beyond it the object may be hidden.
    interpolated
        Nothing was measured there; the depth is what those beside it suggest.
    """

    free_depth: NDArray[np.float32]
    interpolated: NDArray[np.bool_]


def all_free(height: int, width: int) -> FreeSpace:
    """Return the free space of a sensor that saw nothing else."""
    free_depth = np.full((height, width), np.inf, dtype=np.float32)
    return FreeSpace(free_depth, np.zeros((height, width), dtype=np.bool_))


@dataclass(frozen=True, eq=False)
class Observation:
    """An object's points, and from where they were seen.

    Attributes
    ----------
    points
        (N, 3) world frame, metres, finite.
    camera
        The sensor: its intrinsics, the size of its image and its pose in the world. What lies
        outside its image was not seen.
    floor
        Height (metres, world z) up to which points were lost with the support plane.
    free_space
        What was seen elsewhere; ``None``: all of it is empty.
    depth
        (height, width) the same points as the sensor measured them, metres, NaN where it does not
        show the object; ``None``: they are projected into its pixels.
    """

    points: NDArray[np.float32]
    camera: Camera
    floor: float = -np.inf
    free_space: FreeSpace | None = None
    depth: NDArray[np.float32] | None = None

    @cached_property
    def inverse_depth(self) -> NDArray[np.float32]:
        """(height, width) of the object in the sensor's pixels, 1 / m; 0 where it is not seen."""
        if self.depth is None:
            return inverse_depth_of_points(self.points, self.camera)
        visible = self.depth > self.camera.near
        return np.divide(1.0, self.depth, out=np.zeros_like(self.depth), where=visible)
