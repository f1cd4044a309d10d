"""What else is in a room: boards, posters, furniture, other walls, lamps."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kmn_perception.rooms.draw import Draw
from kmn_perception.rooms.room import Cuboid, Light, Lighting, Material, cuboid
from kmn_perception.rooms.settings import LightsSettings, LooksSettings, ThingsSettings

FAR = 7.0  # metres to where walls, floor and ceiling end


class Site(NamedTuple):
    """The place that is furnished, in the wall's frame: x into the wall, y to the left as seen.

    Attributes
    ----------
    wall
        (4, 4) pose of the wall's frame in the world.
    face
        x of the wall's face.
    half
        Half the width of what is in the wall: the door with its frame.
    camera
        (3,) where it stands.
    """

    wall: NDArray[np.float64]
    face: float
    half: float
    camera: NDArray[np.float64]

    def cuboid(
        self,
        name: str,
        x: tuple[float, float],
        y: tuple[float, float],
        z: tuple[float, float],
        material: Material,
        turn: float = 0.0,
    ) -> Cuboid:
        """Return a cuboid by its extents."""
        low, high = zip(x, y, z, strict=True)
        return cuboid(name, low, high, material, self.wall, turn)

    def at(
        self,
        name: str,
        centre: tuple[float, float, float],
        size: tuple[float, float, float],
        material: Material,
        turn: float = 0.0,
    ) -> Cuboid:
        """Return a cuboid by its centre and size."""
        x, y, z = ((c - s / 2.0, c + s / 2.0) for c, s in zip(centre, size, strict=True))
        return self.cuboid(name, x, y, z, material, turn)


def furnish(
    draw: Draw, site: Site, wall: Material, things: ThingsSettings, looks: LooksSettings
) -> list[Cuboid]:
    """Draw what is on the wall and before it."""

    def other() -> Material:
        return draw.material(looks, looks.other, wall)

    found = [*_walls(draw, site, wall, other(), things)]
    found += _skirting(draw, site, other(), things) if draw.chance(things.skirting) else []
    for _ in range(draw.count(things.posters)):
        size = things.poster_size
        width, height = draw.between(size.width), draw.between(size.height)
        y = draw.sign() * (site.half + width / 2.0 + draw.between((0.05, 1.5)))
        thickness = draw.between(size.thickness)
        z = draw.between((0.9 + height / 2.0, 2.3 - height / 2.0))
        centre = (site.face - thickness / 2.0, y, z)
        look = printed(draw, other(), things, looks)
        found.append(site.at("poster", centre, (thickness, width, height), look))
    if draw.chance(things.switch):
        y = draw.sign() * (site.half + draw.between((0.06, 0.25)))
        centre = (site.face - 0.006, y, draw.between((0.95, 1.25)))
        found.append(site.at("switch", centre, (0.012, 0.08, 0.08), other()))
    for _ in range(draw.count(things.furniture)):
        y = draw.sign() * (site.half + draw.between((0.35, 1.6)))
        found += _clear(furniture(draw, site, y, other()), site, things.clearance)
    if draw.chance(things.occluder):
        at = (site.face - draw.between((0.4, 0.9)), draw.between((-0.5, 0.5)))
        found += _clear(chair(draw, site, at, other()), site, things.clearance)
    return found


def _walls(
    draw: Draw, site: Site, wall: Material, other: Material, things: ThingsSettings
) -> list[Cuboid]:
    """Return ceiling, side walls and the wall of the next room."""
    behind, z = draw.between(things.behind), draw.between(things.ceiling)
    dark = other._replace(albedo=draw.between(things.behind_albedo))
    everywhere = (-FAR, FAR)
    found = [
        site.cuboid("behind", (behind, behind + 0.1), everywhere, (0.0, z), dark),
        site.cuboid("ceiling", everywhere, everywhere, (z, z + 0.1), wall._replace(tile=(0, 0))),
    ]
    for side in (-1.0, 1.0):
        distance, far = things.side_distance, draw.between(things.side_distance.far)
        y = site.half + (draw.between(distance.near) if draw.chance(things.side_wall) else far)
        if side * site.camera[1] + things.clearance > y:
            y = site.half + far
        ends = sorted((side * y, side * (y + 0.1)))
        extent = (-FAR, site.face)
        found.append(site.cuboid("side_wall", extent, (ends[0], ends[1]), (0.0, z), wall))
    return found


def _skirting(draw: Draw, site: Site, material: Material, things: ThingsSettings) -> list[Cuboid]:
    size = things.skirting_size
    x = (site.face - draw.between(size.thickness), site.face)
    z = (0.0, draw.between(size.height))
    return [
        site.cuboid("skirting", x, (site.half, FAR), z, material),
        site.cuboid("skirting", x, (-FAR, -site.half), z, material),
    ]


def furniture(draw: Draw, site: Site, y: float, material: Material) -> list[Cuboid]:
    """Draw a cupboard or a chair beside the door."""
    if draw.chance(0.5):
        return chair(draw, site, (site.face - draw.between((0.3, 0.6)), y), material)
    depth, width = draw.between((0.25, 0.6)), draw.between((0.4, 1.0))
    height = draw.between((0.6, 2.1))
    y = float(np.sign(y)) * max(abs(y), site.half + width / 2.0 + 0.03)
    centre = (site.face - 0.01 - depth / 2.0, y, height / 2.0)
    return [site.at("cupboard", centre, (depth, width, height), material)]


def chair(draw: Draw, site: Site, at: tuple[float, float], material: Material) -> list[Cuboid]:
    """Draw a chair: seat, back and legs, all turned alike."""
    seat, size, high = draw.between((0.4, 0.5)), draw.between((0.38, 0.5)), draw.between((0.7, 1.0))
    turn = draw.between((-np.pi, np.pi))
    c, s = np.cos(turn), np.sin(turn)
    inner = size / 2.0 - 0.02
    parts = [
        ((0.0, 0.0, seat), (size, size, 0.04)),
        ((inner, 0.0, (seat + high) / 2.0), (0.03, size, high - seat)),
        *(
            ((a * inner, b * inner, seat / 2.0), (0.03, 0.03, seat))
            for a in (-1.0, 1.0)
            for b in (-1.0, 1.0)
        ),
    ]
    return [
        site.at("chair", (at[0] + c * x - s * y, at[1] + s * x + c * y, z), extent, material, turn)
        for (x, y, z), extent in parts
    ]


def _clear(things: list[Cuboid], site: Site, clearance: float) -> list[Cuboid]:
    """Return things if all of them are off the camera by a clearance, else none."""
    for thing in things:
        middle = (np.linalg.inv(site.wall) @ thing.cube)[:3, 3]
        reach = np.linalg.norm(thing.cube[:2, :2], axis=0).sum() / 2.0
        if np.linalg.norm((middle - site.camera)[:2]) < reach + clearance:
            return []
    return things


def printed(
    draw: Draw, material: Material, things: ThingsSettings, looks: LooksSettings
) -> Material:
    """Draw whether something is written on a material."""
    if draw.chance(things.printed):
        return draw.tiled(material, looks.print, stagger=draw.between((0.0, 0.5)))
    return material


def on_panel(
    draw: Draw,
    panel: NDArray[np.float64],
    size: NDArray[np.float64],
    material: Material,
    things: ThingsSettings,
    looks: LooksSettings,
) -> list[Cuboid]:
    """Draw what is on a panel of a size (3,), of which (4, 4) is the frame."""
    found, front = [], -size[0] / 2.0
    if draw.chance(things.sign):
        width, height = draw.between((0.15, 0.4)), draw.between((0.1, 0.6))
        z = draw.between((1.25 + height / 2.0, 1.75))
        y = draw.between((-0.5, 0.5)) * (size[1] - width - 0.1)
        low = (front - 0.001, y - width / 2.0, z - height / 2.0)
        high = (front, y + width / 2.0, z + height / 2.0)
        look = printed(draw, draw.material(looks, looks.other), things, looks)
        found.append(cuboid("sign", low, high, look, panel))
    if draw.chance(things.hinges):
        look, half = draw.material(looks, looks.other), np.array(things.hinge_size) / 2.0
        for share in things.hinge_heights:
            middle = np.array([front, size[1] / 2.0 - half[1], share * size[2]])
            found.append(cuboid("hinge", middle - half, middle + half, look, panel))
    if draw.chance(things.mouldings):
        side, depth = draw.between((0.12, 0.2)), draw.between((0.004, 0.012))
        inner = size[1] / 2.0 - side
        for z0, z1 in ((0.2, 0.75), (1.25, size[2] - 0.2)):
            for y, z, width, height in (
                (0.0, z0, 2.0 * inner, 0.02),
                (0.0, z1, 2.0 * inner, 0.02),
                (inner, (z0 + z1) / 2.0, 0.02, z1 - z0),
                (-inner, (z0 + z1) / 2.0, 0.02, z1 - z0),
            ):
                low = (front - depth, y - width / 2.0, z - height / 2.0)
                high = (front, y + width / 2.0, z + height / 2.0)
                found.append(cuboid("moulding", low, high, material, panel))
    return found


def draw_lighting(draw: Draw, lights: LightsSettings) -> Lighting:
    """Draw lamps under the ceiling, and whether the first one casts shadows."""
    lamps = tuple(
        Light(
            (draw.between(lights.x), draw.between(lights.y), draw.between(lights.z)),
            draw.between(lights.power),
        )
        for _ in range(draw.count(lights.number))
    )
    softness = draw.between(lights.softness) if draw.chance(lights.shadows) else 0.0
    return Lighting(lamps, draw.between(lights.ambient), softness)
