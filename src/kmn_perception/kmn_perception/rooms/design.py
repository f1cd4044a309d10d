"""Doors before they stand anywhere, and the truth about those that do."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kmn_perception.model.camera import Camera
from kmn_perception.model.room_model import SIDES, RoomModel
from kmn_perception.rooms.draw import Draw
from kmn_perception.rooms.room import Door, Room
from kmn_perception.rooms.settings import DoorSettings

SAMPLES = 101  # of an edge
BESIDE = 0.01  # metres from an edge to where the panel is looked for
ON_PANEL = ("panel", "handle", "fitting", "sign", "moulding", "hinge")
AROUND = ("post", "lintel", "wall")
BUILT_IN = (*ON_PANEL, *AROUND, "seal")
CORNERS = {
    "top_left": (0.5, 0.5),
    "top_right": (-0.5, 0.5),
    "bottom_left": (0.5, -0.5),
    "bottom_right": (-0.5, -0.5),
}  # as seen: fractions of the panel's width and height along y and z
EDGES = {
    "left": ("top_left", "bottom_left"),
    "right": ("top_right", "bottom_right"),
    "top": ("top_left", "top_right"),
    "bottom": ("bottom_left", "bottom_right"),
}


class Design(NamedTuple):
    """Parameters (7,) of a door, its nuisances by name, and its kinds."""

    values: NDArray[np.float64]
    nuisance: dict[str, float]
    handle: str
    side: str
    fitting: str


def draw_design(draw: Draw, model: RoomModel, door: DoorSettings) -> Design:
    """Draw the parameters of a door and of what is around it; theta is 0."""
    low, high = model.model.limits.T
    values = draw.generator.uniform(low, high)
    values[:3] = 0.0
    handle = draw.kind(door.handle)
    fitting = draw.kind(door.fitting) if handle in ("lever", "knob") else "none"
    values[5] = draw.between(door.handle_y[handle])
    values[6] = draw.between(door.handle_height) - 1.0 - values[3] / 2.0
    flush, framed, opening = draw.chance(door.flush), draw.chance(door.frame), 0.0
    if not draw.chance(door.closed):
        opening = draw.between(door.ajar)
        if flush and draw.chance(door.toward):
            opening = -opening
    nuisance = {
        "recess": draw.between(door.recess.flush if flush else door.recess.deep),
        "frame_width": draw.between(door.frame_width) if framed else 0.0,
        "frame_proud": draw.between(door.frame_proud) if framed else 0.0,
        "handle_length": draw.between(door.handle_length),
        "opening": opening,
    }
    side = SIDES[draw.count((0, len(SIDES) - 1))]
    return Design(np.clip(values, low, high), nuisance, handle, side, fitting)


def corners(design: Design, model: RoomModel) -> dict[str, NDArray[np.float64]]:
    """Return the corners (3,) of the panel's front as it stands, in the world, by name as seen."""
    gamma = model.model.split(design.values)[1]
    panel = model.model.body("panel")
    centre, size = panel.centre(gamma), panel.size(gamma)
    pose = model.pose(design.values, design.side, design.nuisance["opening"])
    mirror = -1.0 if design.side == "left" else 1.0
    return {
        name: pose[:3, :3] @ (centre + size * [-0.5, mirror * y, z]) + pose[:3, 3]
        for name, (y, z) in CORNERS.items()
    }


def opening(design: Design, model: RoomModel) -> dict[str, NDArray[np.float64]]:
    """Return the corners (3,) of the closed panel, in the front of the frame or wall around it."""
    closed = design._replace(nuisance=design.nuisance | {"opening": 0.0})
    before = design.nuisance["recess"] + design.nuisance["frame_proud"]
    shift = before * model.pose(design.values)[:3, 0]
    return {name: corner - shift for name, corner in corners(closed, model).items()}


def truth(design: Design, model: RoomModel, camera: Camera) -> Door:
    """Return the truth about a door that a camera sees."""
    theta, gamma = model.model.split(design.values)
    frame = model.pose(design.values, design.side, design.nuisance["opening"])
    to_camera = camera.world_to_camera

    def seen(point: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(to_camera[:3, :3] @ point + to_camera[:3, 3])

    handle = frame[:3, :3] @ model.model.body("handle").centre(gamma) + frame[:3, 3]
    if design.side == "left":  # the panel's own y axis points to the right as seen
        frame = frame @ np.diag([1.0, -1.0, 1.0, 1.0])
    return Door(
        **design._asdict(),
        frame=frame,
        corners={name: seen(point) for name, point in corners(design, model).items()},
        opening={name: seen(point) for name, point in opening(design, model).items()},
        handle_centre=None if design.handle == "none" else seen(handle),
    )


def seen_edges(door: Door, room: Room, bodies: NDArray[np.int16]) -> dict[str, float]:
    """Return which fractions of the panel's edges are in the image, and not hidden by things.

    An edge that frame or wall hide, as the deep reveal of a door that is seen from aside, counts as
    seen: where it must be is seen from them.

    Parameters
    ----------
    bodies
        (height, width) index of the cuboid that is seen, see `Images`.
    """
    return _shares_seen(door.corners, BESIDE, BUILT_IN, room, bodies)


def seen_panel_edges(door: Door, room: Room, bodies: NDArray[np.int16]) -> dict[str, float]:
    """Return which fractions of the panel's edges are seen on the panel itself."""
    return _shares_seen(door.corners, BESIDE, ON_PANEL, room, bodies)


def seen_opening(door: Door, room: Room, bodies: NDArray[np.int16]) -> dict[str, float]:
    """Return which fractions of the opening's edges are seen on the frame or wall around it."""
    return _shares_seen(door.opening, -BESIDE, AROUND, room, bodies)


def _shares_seen(
    corners: dict[str, NDArray[np.float64]],
    inwards: float,
    names: tuple[str, ...],
    room: Room,
    bodies: NDArray[np.int16],
) -> dict[str, float]:
    """Return which fractions of the edges show bodies of some names, so far inwards, metres."""
    own = np.array([body.name.partition("_")[0] in names for body in room.cuboids])
    camera, fractions = replace(room.camera, pose=np.eye(4)), {}
    centre = np.mean(list(corners.values()), axis=0)
    for name, ends in EDGES.items():
        start, end = (corners[corner] for corner in ends)
        to_centre = centre - (start + end) / 2.0
        line = start + np.linspace(0.0, 1.0, SAMPLES)[:, None] * (end - start)
        pixels = camera.project(line + inwards * to_centre / np.linalg.norm(to_centre))
        found = bodies[tuple(np.rint(pixels[inside(pixels, camera), 1::-1]).astype(int).T)]
        fractions[name] = float(own[found[found >= 0]].sum() / SAMPLES)
    return fractions


def inside(pixels: NDArray[np.float64], camera: Camera, margin: float = 0.0) -> NDArray[np.bool_]:
    """Tell which projected points (N, 3) are in the image, off its border by a margin in pixels."""
    u, v, z = pixels.T
    within_u = (u > margin) & (u < camera.width - 1 - margin)
    within_v = (v > margin) & (v < camera.height - 1 - margin)
    found: NDArray[np.bool_] = (z > camera.near) & within_u & within_v
    return found
