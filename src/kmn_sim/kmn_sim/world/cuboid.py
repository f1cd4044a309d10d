"""Cuboids that do not belong to the kinematic model, and portals of them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kmn_perception.model.parts import NO_AXIS

Colour = tuple[float, ...]  # RGBA
Three = tuple[float, float, float]
MATT = (0.0, 0.0, 0.0)  # what surfaces reflect of the light itself, RGB


class Cuboid(NamedTuple):
    """An axis-parallel cuboid in the frame of its link: centre and size (3,) in m, colour RGBA.

    With an ``axis``, it is the cylinder along it that the cuboid holds, see `Body`.
    """

    centre: NDArray[np.float64]
    size: NDArray[np.float64]
    colour: Colour
    axis: int = NO_AXIS

    def unit_cube(self, pose: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the map (4, 4) of the unit cube to the world, where the link has a pose (4, 4)."""
        cube = np.eye(4)
        cube[:3, :3], cube[:3, 3] = np.diag(self.size), self.centre
        return pose @ cube


def cuboid(centre: ArrayLike, size: ArrayLike, colour: Colour) -> Cuboid:
    """Return the cuboid of a centre and a size (3,), metres."""
    return Cuboid(np.array(centre, dtype=np.float64), np.array(size, dtype=np.float64), colour)


def cuboid_between(low: ArrayLike, high: ArrayLike, colour: Colour) -> Cuboid:
    """Return the cuboid between two corners (3,), metres."""
    first, last = np.array(low, dtype=np.float64), np.array(high, dtype=np.float64)
    return Cuboid((first + last) / 2.0, last - first, colour)


class Portal(NamedTuple):
    """Makes posts and lintels around a panel that stands on the floor."""

    panel: Cuboid

    def around(
        self, depth: tuple[float, float], inset: Three, width: Three, colour: Colour
    ) -> list[Cuboid]:
        """Return the left and the right post, and the lintel between them.

        Parameters
        ----------
        depth
            x of their front and back, metres.
        inset
            Distances of left and right post and of the lintel from the panel, metres.
        width
            Of left and right post; and the lintel's height, to which the posts reach; metres.
        """
        (start, end), (_, y, _), (_, panel_width, panel_height) = depth, *self.panel[:2]
        left, right = y + panel_width / 2.0 + inset[0], y - panel_width / 2.0 - inset[1]
        bottom = panel_height + inset[2]
        top = bottom + width[2]
        corners = (
            ((left, 0.0), (left + width[0], top)),
            ((right - width[1], 0.0), (right, top)),
            ((right, bottom), (left, top)),
        )
        return [cuboid_between((start, *low), (end, *high), colour) for low, high in corners]
