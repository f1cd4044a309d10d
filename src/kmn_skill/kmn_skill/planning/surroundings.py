"""What stands around a door, as cuboids that the robot keeps clear of."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kmn_perception.configuration.settings import NonNegative, Positive
from kmn_perception.model.parts import Body

WALL = "wall"


class Obstacle(NamedTuple):
    """A cuboid that stands still.

    Attributes
    ----------
    centre, size
        (3,) in the object frame, metres.
    rotation
        (3, 3) of its axes in that frame; None: they are parallel.
    """

    name: str
    centre: NDArray[np.float64]
    size: NDArray[np.float64]
    rotation: NDArray[np.float64] | None = None


class SurroundingsSettings(NamedTuple):
    """The wall around a door, metres.

    Attributes
    ----------
    gap
        Between panel and frame.
    frame_proud
        By which the frame stands out of the wall; all of the wall is taken to reach so far.
    width, height, thickness
        Of the wall beside the opening, from the floor, and from front to back.
    """

    gap: NonNegative
    frame_proud: NonNegative
    width: Positive
    height: Positive
    thickness: Positive


def wall_around(
    panel: Body,
    gamma: NDArray[np.float64],
    recess: float,
    settings: SurroundingsSettings,
) -> tuple[Obstacle, ...]:
    """Return the wall with its frame to the left, to the right and above a closed door.

    Parameters
    ----------
    panel
        That fills the opening.
    gamma
        (m,) configuration parameters.
    recess
        Of the panel's front behind the wall's face, metres.
    """
    centre, size = panel.centre(gamma), panel.size(gamma)
    front = centre[0] - size[0] / 2.0 - recess - settings.frame_proud
    depth = settings.frame_proud + settings.thickness
    opening = size[1:] / 2.0 + settings.gap
    top = float(centre[2] + opening[1])
    above = max(settings.height - top, settings.width)
    beside = opening[0] + settings.width / 2.0
    x, high = front + depth / 2.0, top + above
    post = np.array([depth, settings.width, high])
    return (
        Obstacle("wall_left", np.array([x, centre[1] + beside, high / 2.0]), post),
        Obstacle("wall_right", np.array([x, centre[1] - beside, high / 2.0]), post),
        Obstacle(
            "wall_above",
            np.array([x, centre[1], top + above / 2.0]),
            np.array([depth, 2.0 * opening[0], above]),
        ),
    )
