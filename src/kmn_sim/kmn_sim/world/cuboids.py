"""Cuboids that a scenario consists of, beside those of the kinematic model."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kmn_sim.world.scenario import Scenario
from kmn_sim.world.settings import BoxSettings, DoorMechanics

FLOOR_SIZE, FLOOR_THICKNESS = 12.0, 0.1  # metres
PANEL, HANDLE = (0.62, 0.46, 0.32, 1.0), (0.75, 0.75, 0.78, 1.0)  # colours
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
    if scenario.stem:
        links["handle"].append(_stem(scenario, panel, links["handle"][0], settings))
    links["world"] = []
    if scenario.frame:
        links["world"] += _portal(panel, settings.gap, settings.frame, settings.frame, FRAME)
    if scenario.wall:
        inset = settings.gap + (settings.frame if scenario.frame else 0.0)
        thickness = settings.wall_thickness
        above = settings.wall_height - panel.size[2] - inset
        links["world"] += _portal(panel, inset, settings.wall_width, thickness, WALL, above)
    return links


def floor_cuboid(scenario: Scenario, settings: BoxSettings) -> Cuboid:
    """Return the floor, in the world frame."""
    top = -settings.table_height if scenario.table else 0.0
    centre = (0.0, 0.0, top - FLOOR_THICKNESS / 2.0)
    return _cuboid(centre, (FLOOR_SIZE, FLOOR_SIZE, FLOOR_THICKNESS), FLOOR)


def table_cuboids(settings: BoxSettings) -> list[Cuboid]:
    """Return a table's top and its foot, in the world frame."""
    thickness, height = settings.table_thickness, settings.table_height
    foot = height - thickness
    return [
        _cuboid(
            (0.0, 0.0, -thickness / 2.0),
            (settings.table_width, settings.table_depth, thickness),
            TABLE,
        ),
        _cuboid(
            (0.0, 0.0, -thickness - foot / 2.0),
            (settings.table_width / 2.0, settings.table_depth / 2.0, foot),
            TABLE,
        ),
    ]


def _stem(scenario: Scenario, panel: Cuboid, lever: Cuboid, settings: DoorMechanics) -> Cuboid:
    """Return the stem, which fills the space between lever and panel at the lever's pivot."""
    joint = next(joint for joint in scenario.model.joints if joint.body == "handle")
    start = lever.centre[0] + lever.size[0] / 2.0
    end = panel.centre[0] - panel.size[0] / 2.0
    pivot = joint.origin(scenario.gamma)
    y = np.clip(
        pivot[1],
        lever.centre[1] - (lever.size[1] - settings.stem) / 2.0,
        lever.centre[1] + (lever.size[1] - settings.stem) / 2.0,
    )
    centre = ((start + end) / 2.0, y, pivot[2])
    return _cuboid(centre, (end - start, settings.stem, settings.stem), HANDLE)


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
