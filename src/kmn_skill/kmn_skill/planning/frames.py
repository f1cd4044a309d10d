"""Frames in a configuration of the package robotic."""

from __future__ import annotations

from typing import Any

import numpy as np
import robotic as ry
from numpy.typing import NDArray

from kmn_perception.model.rotation import quaternion_from_matrix

MAX_ROUNDING = 0.4  # a corner's radius is limited to this part of the box


def add_box(
    configuration: Any,
    name: str,
    parent: str,
    centre: NDArray[np.float64],
    size: NDArray[np.float64],
    rounding: float,
) -> None:
    """Add a box with rounded edges at a place in a frame; see `MAX_ROUNDING`."""
    radius = min(rounding, MAX_ROUNDING * size.min())
    add_frame(configuration, name, parent, centre).setShape(ry.ST.ssBox, [*size, radius])


def add_frame(
    configuration: Any,
    name: str,
    parent: str,
    position: NDArray[np.float64],
    rotation: NDArray[np.float64] | None = None,
) -> Any:
    """Add a frame at a place in its parent's."""
    frame = configuration.addFrame(name, parent)
    frame.setRelativePosition(position)
    if rotation is not None:
        x, y, z, w = quaternion_from_matrix(rotation)
        frame.setRelativeQuaternion([w, x, y, z])
    return frame
