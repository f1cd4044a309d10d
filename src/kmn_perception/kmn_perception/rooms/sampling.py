"""Random rooms by their seeds: with a door in a wall, or with what could be taken for one."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import NamedTuple
from zlib import crc32

from kmn_perception.model.camera import Camera
from kmn_perception.model.room_model import RoomModel
from kmn_perception.rooms import negatives
from kmn_perception.rooms.building import Plan, build_door
from kmn_perception.rooms.design import Design, corners, draw_design
from kmn_perception.rooms.draw import Draw
from kmn_perception.rooms.placing import edges_in_view, place
from kmn_perception.rooms.room import Room
from kmn_perception.rooms.settings import RoomSettings


class Kind(NamedTuple):
    """A kind of room: how it is built, and which places of the camera suit it."""

    build: Callable[[Plan, str], Room]
    suits: Callable[[Plan], bool] | None = None


def _one_edge(plan: Plan) -> bool:
    margin = plan.settings.camera.margin
    return edges_in_view(plan.camera, plan.design, plan.model, -margin) == 1


def _no_floor(plan: Plan) -> bool:
    """Tell whether the floor before the door is below the image."""
    found = corners(plan.design, plan.model)
    rows = [plan.camera.project(found[name])[1:] for name in ("bottom_left", "bottom_right")]
    both = edges_in_view(plan.camera, plan.design, plan.model, 0.0) == 2
    return both and all(z > 0.0 and v > 1.2 * plan.camera.height for v, z in rows)


def _within_corridor(plan: Plan) -> bool:
    return bool(abs(plan.site.camera[1]) < plan.settings.negatives.corridor_half[0] - 0.2)


KINDS = {
    "door": Kind(build_door),
    "person": Kind(negatives.build_person),
    "one_edge": Kind(build_door, _one_edge),
    "no_floor": Kind(build_door, _no_floor),
    "wide_open": Kind(build_door),
    "wall": Kind(negatives.build_wall),
    "brick": Kind(negatives.build_wall),
    "cupboard": Kind(negatives.build_wall),
    "window": Kind(negatives.build_wall),
    "poster": Kind(negatives.build_wall),
    "corridor": Kind(negatives.build_corridor, _within_corridor),
    "glass": Kind(negatives.build_glass),
    "double": Kind(negatives.build_double),
    "doorway": Kind(negatives.build_doorway),
}

WITH_DOOR = (build_door, negatives.build_person)
NEGATIVES = tuple(name for name, kind in KINDS.items() if kind.build not in WITH_DOOR)

_model = cache(RoomModel.load)  # which takes longer than all draws


def sample_room(seed: int, camera: Camera, settings: RoomSettings, kind: str = "door") -> Room:
    """Return the room of a seed, seen by a camera of which only the pose is drawn.

    Parameters
    ----------
    kind
        One of ``KINDS``; all but ``NEGATIVES`` have a door.
    """
    draw, model = Draw(seed, crc32(kind.encode())), _model(settings.model)
    design, where = draw_design(draw, model, settings.door), settings.camera
    if kind == "one_edge":
        where = where._replace(heading=settings.negatives.one_edge_heading)
    elif kind == "no_floor":
        where = where._replace(aim=settings.negatives.no_floor_aim)
    elif kind == "wide_open":
        wide = {"opening": draw.between(settings.negatives.wide_open)}
        design = design._replace(nuisance=design.nuisance | wide)
    needed, suits = 2 if draw.chance(where.both_edges) else 1, KINDS[kind].suits

    def acceptable(seen_by: Camera, placed: Design) -> bool:
        if suits is not None:
            return suits(Plan(draw, placed, model, seen_by, settings))
        return edges_in_view(seen_by, placed, model, where.margin) >= needed

    placed, seen_by = place(draw, design, model, camera, where, acceptable)
    return KINDS[kind].build(Plan(draw, placed, model, seen_by, settings), kind)
