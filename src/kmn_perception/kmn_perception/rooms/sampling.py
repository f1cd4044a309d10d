"""Random rooms by their seeds: a door in a wall, what is around it, and where the camera stands."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from kmn_perception.model.camera import Camera
from kmn_perception.model.room_model import RoomModel
from kmn_perception.rooms.design import Design, draw_design, truth
from kmn_perception.rooms.draw import Draw
from kmn_perception.rooms.furnishing import Site, draw_lighting, furnish, on_panel
from kmn_perception.rooms.placing import edges_in_view, place
from kmn_perception.rooms.room import Cuboid, Material, Room
from kmn_perception.rooms.settings import LooksSettings, RoomSettings


def sample_room(seed: int, camera: Camera, settings: RoomSettings) -> Room:
    """Return the room with a door of a seed, seen by a camera of which only the pose is drawn."""
    draw, model = Draw(seed), RoomModel.load(settings.model)
    design = draw_design(draw, model, settings.door)
    where = settings.camera
    needed = 2 if draw.chance(where.both_edges) else 1
    placed, seen_by = place(
        draw, design, model, camera, where,
        lambda c, d: edges_in_view(c, d, model, where.margin) >= needed,
    )  # fmt: skip
    return door_room(draw, placed, model, seen_by, settings)


def door_room(
    draw: Draw, design: Design, model: RoomModel, camera: Camera, settings: RoomSettings
) -> Room:
    """Return the room around a door that has its place."""
    materials = draw_materials(draw, settings.looks)
    names, cubes = model.cubes(
        design.values,
        model.nuisances(**design.nuisance),
        design.handle,
        design.side,
        design.fitting,
    )
    built = [
        Cuboid(name, cube, materials[name.partition("_")[0]])
        for name, cube in zip(names, cubes, strict=True)
    ]
    size = model.model.body("panel").size(model.model.split(design.values)[1])
    panel = model.pose(design.values, design.side, design.nuisance["opening"])
    site = site_of(design, model, size, camera)
    things, looks = settings.things, settings.looks
    return Room(
        kind="door",
        cuboids=(
            *on_panel(draw, panel, size, materials["panel"], things, looks),
            *built,
            *furnish(draw, site, materials["wall"], things, looks),
        ),
        wall=site.wall,
        lighting=draw_lighting(draw, settings.lights),
        camera=camera,
        door=truth(design, model, camera),
    )


def site_of(design: Design, model: RoomModel, size: NDArray[np.float64], camera: Camera) -> Site:
    """Return where a door of a size (3,) stands."""
    wall = model.pose(design.values)
    nuisance = design.nuisance
    return Site(
        wall=wall,
        face=float(-size[0] / 2.0 - nuisance["recess"]),
        half=float(size[1] / 2.0 + nuisance["frame_width"] + 0.004),
        camera=(np.linalg.inv(wall) @ camera.pose)[:3, 3],
    )


def draw_materials(draw: Draw, looks: LooksSettings) -> Mapping[str, Material]:
    """Draw how the bodies of the model look, by the first words of their names."""
    wall = draw.material(looks, looks.wall)
    panel = draw.material(looks, looks.panel, wall)
    if draw.chance(looks.wood):
        along = panel.grain[2] * looks.stretch
        panel = panel._replace(grain=(panel.grain[0], panel.grain[1], along))
    frame = draw.material(looks, looks.other, wall if draw.chance(0.5) else panel)
    handle = draw.material(looks, looks.other)
    if draw.chance(looks.tiles):
        wall = draw.tiled(wall, looks.tile, stagger=0.0)
    floor = draw.material(looks, looks.other)
    return {
        "panel": panel,
        "handle": handle,
        "fitting": handle,
        "wall": wall,
        "post": frame,
        "lintel": frame,
        "seal": draw.material(looks, looks.seal),
        "floor": floor,
    }
