"""Rooms around a door that has its place before a camera."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kmn_perception.model.camera import Camera
from kmn_perception.model.room_model import RoomModel
from kmn_perception.rooms.design import Design, truth
from kmn_perception.rooms.draw import Draw
from kmn_perception.rooms.furnishing import Site, draw_lighting, furnish, on_panel
from kmn_perception.rooms.room import Cuboid, Material, Room
from kmn_perception.rooms.settings import LooksSettings, RoomSettings

GAP = 0.004  # metres between the panel and what is around it


class Plan(NamedTuple):
    """A door that has its place before a camera, and what is needed to build a room around it."""

    draw: Draw
    design: Design
    model: RoomModel
    camera: Camera
    settings: RoomSettings

    @property
    def size(self) -> NDArray[np.float64]:
        """(3,) of the panel, metres."""
        gamma = self.model.model.split(self.design.values)[1]
        return self.model.model.body("panel").size(gamma)

    @property
    def panel(self) -> NDArray[np.float64]:
        """(4, 4) pose of the panel's frame; a reflection if the handle is at the left."""
        return self.model.pose(
            self.design.values, self.design.side, self.design.nuisance["opening"]
        )

    @property
    def site(self) -> Site:
        """The wall around the door."""
        wall, nuisance = self.model.pose(self.design.values), self.design.nuisance
        return Site(
            wall=wall,
            face=float(-self.size[0] / 2.0 - nuisance["recess"]),
            half=float(self.size[1] / 2.0 + nuisance["frame_width"] + GAP),
            camera=(np.linalg.inv(wall) @ self.camera.pose)[:3, 3],
        )

    def cuboids(self, materials: Mapping[str, Material]) -> list[Cuboid]:
        """Return the bodies of the model, with materials by the first words of their names."""
        design = self.design
        nuisance = self.model.nuisances(**design.nuisance)
        kinds = (design.handle, design.side, design.fitting)
        names, cubes = self.model.cubes(design.values, nuisance, *kinds)
        return [
            Cuboid(name, cube, materials[name.partition("_")[0]])
            for name, cube in zip(names, cubes, strict=True)
        ]

    def room(
        self,
        kind: str,
        cuboids: Iterable[Cuboid],
        wall: Material | None,
        glass: tuple[str, ...] = (),
    ) -> Room:
        """Return a room of some bodies, what is about a wall, and lamps; without a door's truth."""
        things, looks, lights = self.settings.things, self.settings.looks, self.settings.lights
        more = furnish(self.draw, self.site, wall, things, looks) if wall else []
        return Room(
            kind=kind,
            cuboids=(*cuboids, *more),
            wall=self.site.wall,
            lighting=draw_lighting(self.draw, lights),
            camera=self.camera,
            door=None,
            glass=glass,
        )


def build_door(plan: Plan, kind: str, more: Iterable[Cuboid] = ()) -> Room:
    """Return the room around a door, with more bodies in it."""
    things, looks = plan.settings.things, plan.settings.looks
    materials = draw_materials(plan.draw, looks)
    on_it = on_panel(plan.draw, plan.panel, plan.size, materials["panel"], things, looks)
    bodies = [*on_it, *plan.cuboids(materials), *more]
    room = plan.room(kind, bodies, materials["wall"])
    return replace(room, door=truth(plan.design, plan.model, plan.camera))


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
