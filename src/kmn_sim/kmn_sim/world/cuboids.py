"""Cuboids that a scenario consists of, beside those of the kinematic model."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kmn_sim.world.scenario import Scenario
from kmn_sim.world.settings import DoorMechanics, FloorSettings, TableSettings

# Colours, RGBA.
PANEL, HANDLE = (0.62, 0.46, 0.32, 1.0), (0.75, 0.75, 0.78, 1.0)
FRAME, WALL, FLOOR = (0.45, 0.33, 0.24, 1.0), (0.86, 0.86, 0.83, 1.0), (0.55, 0.57, 0.6, 1.0)
TABLE, CARTON = (0.6, 0.52, 0.42, 1.0), (0.72, 0.55, 0.36, 1.0)


class Cuboid(NamedTuple):
    """An axis-parallel cuboid in the frame of its link: centre and size (3,) in m, colour RGBA."""

    centre: NDArray[np.float64]
    size: NDArray[np.float64]
    colour: tuple[float, ...]

    def unit_cube(self, pose: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the map (4, 4) of the unit cube to the world, where the link has a pose (4, 4)."""
        cube = np.eye(4)
        cube[:3, :3], cube[:3, 3] = np.diag(self.size), self.centre
        return pose @ cube


def door_cuboids(scenario: Scenario, settings: DoorMechanics) -> dict[str, list[Cuboid]]:
    """Return the cuboids of a door's links in the object frame: of the bodies, and of ``world``.

    The stem belongs to the body that turns about its axis, the handle.
    """
    gamma = scenario.gamma
    colours = {"panel": PANEL, "handle": HANDLE}
    links = {
        body.name: [_cuboid(body.centre(gamma), body.size(gamma), colours.get(body.name, PANEL))]
        for body in scenario.model.bodies
    }
    panel = links["panel"][0]
    stem = scenario.model.stem
    if scenario.stem and stem is not None:
        links[stem.body.name].append(_cuboid(*stem.cuboid(gamma), HANDLE))
    links["world"] = []
    frame, wall = settings.frame, settings.wall
    if scenario.frame:
        links["world"] += _portal(panel, frame.gap, frame.thickness, frame.thickness, FRAME)
    if scenario.wall:
        inset = frame.gap + (frame.thickness if scenario.frame else 0.0)
        above = wall.height - panel.size[2] - inset
        links["world"] += _portal(panel, inset, wall.width, wall.thickness, WALL, above)
    return links


def floor_cuboid(top: float, settings: FloorSettings) -> Cuboid:
    """Return a floor whose surface has a height in the world frame, metres."""
    centre = (0.0, 0.0, top - settings.thickness / 2.0)
    return _cuboid(centre, (settings.size, settings.size, settings.thickness), FLOOR)


def table_cuboids(settings: TableSettings) -> list[Cuboid]:
    """Return a table's top and its foot, in the world frame."""
    height, width, depth, thickness = settings
    foot = height - thickness
    return [
        _cuboid((0.0, 0.0, -thickness / 2.0), (width, depth, thickness), TABLE),
        _cuboid((0.0, 0.0, -thickness - foot / 2.0), (width / 2.0, depth / 2.0, foot), TABLE),
    ]


def _portal(
    panel: Cuboid,
    inset: float,
    width: float,
    thickness: float,
    colour: tuple[float, ...],
    above: float | None = None,
) -> list[Cuboid]:
    """Return two posts beside the panel and a lintel above it, ``inset`` away from it."""
    left, top = panel.size[1] / 2.0 + inset, panel.size[2] + inset
    above = width if above is None else above
    x, y = panel.centre[:2]
    posts = [
        _cuboid(
            (x, y + side * (left + width / 2.0), (top + above) / 2.0),
            (thickness, width, top + above),
            colour,
        )
        for side in (-1.0, 1.0)
    ]
    lintel = _cuboid((x, y, top + above / 2.0), (thickness, 2.0 * left, above), colour)
    return [*posts, lintel]


def _cuboid(centre: ArrayLike, size: ArrayLike, colour: tuple[float, ...]) -> Cuboid:
    return Cuboid(np.array(centre, dtype=np.float64), np.array(size, dtype=np.float64), colour)
