"""Rooms in which a door is missing, or hard to see: what must not become a door by mistake."""

from __future__ import annotations

import numpy as np

from kmn_perception.rooms.building import Plan, build_door, draw_materials
from kmn_perception.rooms.draw import Draw
from kmn_perception.rooms.furnishing import FAR, Site
from kmn_perception.rooms.room import Cuboid, Material, Room, cuboid

THICK = 0.25  # metres; of walls


def build_wall(plan: Plan, kind: str) -> Room:
    """Return a wall without a door; of bricks, or with something on it that is like a door."""
    draw, looks, site = plan.draw, plan.settings.looks, plan.site
    materials = dict(draw_materials(draw, looks))
    if kind == "brick":
        materials["wall"] = draw.tiled(materials["wall"], looks.brick, stagger=0.5)
    wall, bodies = materials["wall"], []
    lost = kind == "window" and draw.chance(0.7)
    if kind == "cupboard":
        bodies = _cupboard(plan, materials)
    elif kind == "window":
        bodies = _window(plan, materials)
    elif kind == "poster":
        bodies = [_on_wall(plan, "poster", materials["panel"], plan.draw.between((0.001, 0.01)))]
    bodies += [
        site.cuboid("wall", (site.face, site.face + THICK), (-FAR, FAR), (0.0, 4.0), wall),
        site.cuboid("floor", (-FAR, FAR), (-FAR, FAR), (-0.1, 0.0), materials["floor"]),
    ]
    return plan.room(kind, bodies, wall, ("glass",) if lost else ())


def build_corridor(plan: Plan, kind: str) -> Room:
    """Return a corridor: two walls along the view, and its end far away."""
    draw, site, ranges = plan.draw, plan.site, plan.settings.negatives
    materials = draw_materials(draw, plan.settings.looks)
    far, high = draw.between(ranges.corridor_length), draw.between(plan.settings.things.ceiling)
    floor, wall = materials["floor"], materials["wall"]
    left, right = (draw.between(ranges.corridor_half) for _ in range(2))
    along, across = (-FAR, far), (-right - THICK, left + THICK)
    bodies = [
        site.cuboid("wall", along, (left, left + THICK), (0.0, high), wall),
        site.cuboid("wall", along, (-right - THICK, -right), (0.0, high), wall),
        site.cuboid("end", (far, far + THICK), across, (0.0, high), materials["panel"]),
        site.cuboid("floor", along, across, (-0.1, 0.0), floor),
        site.cuboid("ceiling", along, across, (high, high + 0.1), materials["seal"]),
    ]
    for _ in range(draw.count(plan.settings.things.posters)):
        x, z = draw.between((-2.0, far - 1.0)), draw.between((1.2, 1.8))
        side = draw.sign()
        y = left - 0.01 if side > 0.0 else 0.01 - right
        size = (draw.between((0.2, 1.0)), 0.02, draw.between((0.3, 0.9)))
        bodies.append(site.at("poster", (x, y, z), size, materials["post"]))
    return plan.room(kind, bodies, None)


def build_glass(plan: Plan, kind: str) -> Room:
    """Return a door of which the rim is solid only: there is no depth within, or that behind."""
    draw = plan.draw
    materials = draw_materials(draw, plan.settings.looks)
    _, width, height = plan.size
    rim, half = draw.between(plan.settings.negatives.rim), width / 2.0
    parts = (
        ("stile", (half - rim, half), (0.0, height)),
        ("stile", (-half, rim - half), (0.0, height)),
        ("rail", (rim - half, half - rim), (0.0, rim)),
        ("rail", (rim - half, half - rim), (height - rim, height)),
        ("glass", (rim - half, half - rim), (rim, height - rim)),
    )
    lost = draw.chance(0.5)
    panes = [
        cuboid(name, (-0.01, y[0], z[0]), (0.01, y[1], z[1]), materials["panel"], plan.panel)
        for name, y, z in parts
        if lost or name != "glass"
    ]
    around = [body for body in plan.cuboids(materials) if body.name != "panel"]
    return plan.room(kind, [*panes, *around], materials["wall"], ("glass",))


def build_double(plan: Plan, kind: str) -> Room:
    """Return a door of two leaves, whose handles are in the middle."""
    materials = draw_materials(plan.draw, plan.settings.looks)
    width, across = plan.size[1], plan.site.wall[:2, 1]
    twice = plan.design.values.copy()
    twice[4] += width
    opened = plan.design.nuisance | {"opening": 0.0}
    wide = plan._replace(design=plan.design._replace(values=twice, nuisance=opened))
    bodies = [body for body in wide.cuboids(materials) if _is_around(body)]
    for side, shift in (("right", 0.5), ("left", -0.5)):
        values = plan.design.values.copy()
        values[:2] += shift * width * across
        leaf = plan._replace(design=plan.design._replace(values=values, side=side))
        bodies += [body for body in leaf.cuboids(materials) if not _is_around(body)]
    return wide.room(kind, bodies, materials["wall"])


def build_doorway(plan: Plan, kind: str) -> Room:
    """Return the opening of a door that is not there."""
    materials = draw_materials(plan.draw, plan.settings.looks)
    bodies = [body for body in plan.cuboids(materials) if _is_around(body)]
    return plan.room(kind, bodies, materials["wall"])


def build_person(plan: Plan, kind: str) -> Room:
    """Return a door with somebody before it."""
    return build_door(plan, kind, person(plan.draw, plan.site, plan.settings.looks.other))


def person(draw: Draw, site: Site, albedo: tuple[float, float]) -> list[Cuboid]:
    """Draw somebody who stands half way between the camera and the door, turned anyhow."""
    tall, turn = draw.between((1.55, 1.95)), draw.between((-np.pi, np.pi))
    share = draw.between((0.35, 0.7))
    x, y = site.camera[:2] * share + np.array([site.face, draw.between((-0.3, 0.3))]) * (1 - share)
    c, s = np.cos(turn), np.sin(turn)
    clothes, legs, skin = (Material(draw.between(albedo), 0.03) for _ in range(3))
    parts = (
        ((0.0, 0.1, 0.235), (0.16, 0.15, 0.47), legs),
        ((0.0, -0.1, 0.235), (0.16, 0.15, 0.47), legs),
        ((0.0, 0.0, 0.65), (0.22, 0.4, 0.36), clothes),
        ((0.0, 0.26, 0.64), (0.1, 0.1, 0.36), clothes),
        ((0.0, -0.26, 0.64), (0.1, 0.1, 0.36), clothes),
        ((0.0, 0.0, 0.92), (0.2, 0.16, 0.16), skin),
    )  # heights as fractions of the whole
    return [
        site.at("person", (x + c * a - s * b, y + s * a + c * b, tall * z), size, look, turn)
        for (a, b, z), (deep, wide, high), look in parts
        for size in [(deep, wide, tall * high)]
    ]


def _is_around(body: Cuboid) -> bool:
    return body.name.partition("_")[0] not in ("panel", "handle", "fitting")


def _on_wall(plan: Plan, name: str, material: Material, thickness: float) -> Cuboid:
    """Return something as large as a door on the wall."""
    site, (_, width, height) = plan.site, plan.size
    z = plan.draw.between((0.0, 0.25))
    x = (site.face - thickness, site.face)
    return site.cuboid(name, x, (-width / 2.0, width / 2.0), (z, height), material)


def _cupboard(plan: Plan, materials: dict[str, Material]) -> list[Cuboid]:
    """Return a cupboard with two doors and their handles."""
    draw, site, (_, width, height) = plan.draw, plan.site, plan.size
    front = site.face - draw.between(plan.settings.negatives.cupboard_depth)
    high, half, gap = height - 0.1, width / 2.0, 0.002
    bodies = [
        site.cuboid("body", (front, site.face), (-half, half), (0.0, high), materials["wall"])
    ]
    for sign in (-1.0, 1.0):
        ends = sorted((sign * gap, sign * (half - gap)))
        door = ((front - 0.02, front), (ends[0], ends[1]), (0.08, high - 0.005))
        bodies.append(site.cuboid("door", *door, materials["panel"]))
        centre = (front - 0.035, sign * 0.05, high / 2.0)
        bodies.append(site.at("pull", centre, (0.03, 0.015, 0.15), materials["handle"]))
    return bodies


def _window(plan: Plan, materials: dict[str, Material]) -> list[Cuboid]:
    """Return a window: panes, and the frame around them."""
    draw, site, half = plan.draw, plan.site, plan.size[1] / 2.0
    low, high = draw.between(plan.settings.negatives.sill), draw.between((1.9, 2.3))
    bar, depth = 0.06, draw.between((0.01, 0.05))
    x, panes = (site.face - depth, site.face), (site.face - 0.002, site.face)
    frame, glass = materials["post"], Material(draw.between((0.05, 0.9)))
    return [
        site.cuboid("frame", x, (half - bar, half), (low, high), frame),
        site.cuboid("frame", x, (-half, bar - half), (low, high), frame),
        site.cuboid("frame", x, (bar - half, half - bar), (low, low + bar), frame),
        site.cuboid("frame", x, (bar - half, half - bar), (high - bar, high), frame),
        site.cuboid("glass", panes, (bar - half, half - bar), (low + bar, high - bar), glass),
    ]
