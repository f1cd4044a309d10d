"""Cuboids that a scenario consists of, beside those of the kinematic model."""

from __future__ import annotations

import numpy as np

from kmn_perception.model.parts import WORLD
from kmn_sim.world.cuboid import Colour, Cuboid, Portal, cuboid
from kmn_sim.world.scenario import Scenario
from kmn_sim.world.settings import DoorSurroundings, FloorSettings, TableSettings

# Colours, RGBA.
PANEL, HANDLE = (0.62, 0.46, 0.32, 1.0), (0.75, 0.75, 0.78, 1.0)
FRAME, WALL, FLOOR = (0.45, 0.33, 0.24, 1.0), (0.86, 0.86, 0.83, 1.0), (0.55, 0.57, 0.6, 1.0)
CARCASS = (0.8, 0.78, 0.74, 1.0)
TABLE, CARTON = (0.6, 0.52, 0.42, 1.0), (0.72, 0.55, 0.36, 1.0)


def object_cuboids(scenario: Scenario, settings: DoorSurroundings) -> dict[str, list[Cuboid]]:
    """Return the cuboids of an object's links in the object frame: what joints move, and ``world``.

    To the latter belong the bodies that no joint moves, and what stands around the object. The stem
    belongs to the body that turns about its axis.
    """
    gamma, action = scenario.gamma, scenario.action
    colours: dict[str, Colour] = {action.joint.body: PANEL, action.grasp.body.name: HANDLE}
    if scenario.room is not None:
        colours[action.joint.body] = scenario.room.colours["panel"]
    moved = [joint.body for joint in scenario.model.joints]
    links: dict[str, list[Cuboid]] = {name: [] for name in (WORLD, *moved)}
    for body in scenario.model.bodies:
        link = body.name if body.name in moved else WORLD
        colour = colours.get(body.name, PANEL if link != WORLD else CARCASS)
        links[link].append(Cuboid(body.centre(gamma), body.size(gamma), colour, body.axis))
    stem = scenario.model.stem
    if scenario.stem and stem is not None:
        links[stem.body.name].append(cuboid(*stem.cuboid(gamma), HANDLE))
    links[WORLD] += _surroundings(scenario, links[action.joint.body][0], settings)
    return links


def _surroundings(scenario: Scenario, panel: Cuboid, settings: DoorSurroundings) -> list[Cuboid]:
    """Return what stands around a door: its room, or frame and wall alone."""
    if scenario.room is not None:
        hinge = scenario.action.joint.origin(scenario.gamma)
        side = float(np.sign(hinge[1] - panel.centre[1]))
        return scenario.room.cuboids(panel, side, -1.0 if scenario.direction == "pull" else 1.0)
    frame, wall, portal = settings.frame, settings.wall, Portal(panel)
    x, found = float(panel.centre[0]), list[Cuboid]()
    if scenario.frame:
        depth = x - frame.thickness / 2.0, x + frame.thickness / 2.0
        found += portal.around(depth, (frame.gap,) * 3, (frame.thickness,) * 3, FRAME)
    if scenario.wall:
        inset = frame.gap + (frame.thickness if scenario.frame else 0.0)
        above = wall.height - float(panel.size[2]) - inset
        depth = x - wall.thickness / 2.0, x + wall.thickness / 2.0
        found += portal.around(depth, (inset,) * 3, (wall.width, wall.width, above), WALL)
    return found


def floor_cuboid(top: float, settings: FloorSettings, colour: Colour) -> Cuboid:
    """Return a floor whose surface has a height in the world frame, metres."""
    centre = (0.0, 0.0, top - settings.thickness / 2.0)
    return cuboid(centre, (settings.size, settings.size, settings.thickness), colour)


def table_cuboids(settings: TableSettings) -> list[Cuboid]:
    """Return a table's top and its foot, in the world frame."""
    height, width, depth, thickness = settings
    foot = height - thickness
    return [
        cuboid((0.0, 0.0, -thickness / 2.0), (width, depth, thickness), TABLE),
        cuboid((0.0, 0.0, -thickness - foot / 2.0), (width / 2.0, depth / 2.0, foot), TABLE),
    ]
