"""Labels of rendered rooms, in the format of labelled frames of doors: JSON beside the images.

Positions are in the camera's optical frame, metres; each value has a standard deviation, here 0.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from kmn_perception.model.camera import Camera
from kmn_perception.rooms.design import EDGES, seen_edges
from kmn_perception.rooms.frame import Frame
from kmn_perception.rooms.room import Door

DIGITS = 6
VISIBLE = 0.2  # fraction of an edge, from which on it counts as visible
CLOSED = 0.5  # degrees of opening, up to which a door counts as closed


def label(frame: Frame, name: str, source: dict[str, Any]) -> dict[str, Any]:
    """Return the label of a frame.

    Parameters
    ----------
    name
        Of the frame: its files are NAME_d.png, or NAME_raw.png where the calibration is off,
        NAME_colour.jpg and NAME.json.
    source
        How it was made.
    """
    room, camera = frame.room, frame.room.camera
    result: dict[str, Any] = {
        "frame": name,
        "door_id": name,
        "kind": room.kind,
        "split": "rendered",
        "source": {**source, "offset_1_per_m": round(frame.offset, DIGITS)},
        "intrinsics": {
            "width": camera.width,
            "height": camera.height,
            "K": camera.matrix.tolist(),
            "D": [0.0] * 5,
            "D_plumb_bob_colour_only": [0.0] * 5,
        },
    }
    if room.door is None:
        return {**result, "state": None, "door": None}
    door = room.door
    opening = float(np.degrees(door.nuisance["opening"]))
    return {
        **result,
        "state": "closed" if abs(opening) < CLOSED else "ajar",
        "handle_kind": door.handle,
        "handle_side": door.side,
        "fitting": door.fitting,
        "door": {
            "values": _rounded(door.values),
            "nuisance": {key: round(value, DIGITS) for key, value in door.nuisance.items()},
        },
        "annotations": {
            "edges": {
                name: {"visible": seen >= VISIBLE, "seen": round(seen, 2)}
                for name, seen in seen_edges(door, room, frame.images.bodies).items()
            }
        },
        "reference": {"metric": metric(door, camera)},
    }


def metric(door: Door, camera: Camera) -> dict[str, Any]:
    """Return what a frame's reference says of a door that is known exactly."""
    to_camera = camera.world_to_camera
    axes = to_camera[:3, :3] @ door.frame[:3, :3]
    normal, up, right = -axes[:, 0], axes[:, 2], -axes[:, 1]
    at = door.corners
    centre = np.mean(list(at.values()), axis=0)
    handle: dict[str, Any] = {"handle_above_floor": None}
    if door.handle_centre is not None:
        height = camera.pose[2, :3] @ door.handle_centre + camera.pose[2, 3]
        handle = {
            "centre": {"p": _rounded(door.handle_centre), "sd": [0.0] * 3},
            "handle_above_floor": _value(float(height)),
        }
    width = float(np.linalg.norm(at["top_right"] - at["top_left"]))
    height = float(np.linalg.norm(at["top_left"] - at["bottom_left"]))
    world = camera.pose.copy()
    world[:2, 3] = 0.0
    opening = float(np.degrees(door.nuisance["opening"]))
    distance = float(centre @ normal)
    return {
        "panel_plane": {
            "normal_towards_camera": _rounded(normal),
            "offset_m": round(-distance, DIGITS),
            "centre": _rounded(centre),
            "view_angle_deg": round(
                float(np.degrees(np.arccos(abs(distance) / np.linalg.norm(centre)))), 3
            ),
            "sd_yaw_deg": 0.0,
            "sd_pitch_deg": 0.0,
            "sd_offset_m": 0.0,
        },
        "up": _rounded(up),
        "right": _rounded(right),
        "edges_3d": {
            side: {
                "top": _rounded(at[EDGES[side][0]]),
                "bottom": _rounded(at[EDGES[side][1]]),
                "sd_lateral_m": 0.0,
            }
            for side in ("left", "right")
        },
        "corners": {name: {"p": _rounded(p), "sd": [0.0] * 3} for name, p in at.items()},
        "width": _value(width),
        "height": _value(height),
        "top_above_floor": _value(height),
        "handle": handle,
        "opening_angle_deg": {
            **_value(abs(opening)),
            "direction": "away from the camera" if opening > 0.0 else "towards the camera",
        },
        "world": {
            "T_world_camera": [_rounded(row) for row in world],
            "camera_height_m": _value(float(world[2, 3])),
        },
    }


def _value(value: float) -> dict[str, float]:
    return {"value": round(value, DIGITS), "sd": 0.0}


def _rounded(values: NDArray[np.float64]) -> list[float]:
    return [round(float(value), DIGITS) for value in values]
