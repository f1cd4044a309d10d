"""A door whose label, and whose estimates, are made by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from kmn_perception.doors.door_estimate import DoorEstimate, DoorStatus
from kmn_perception.doors.geometry import DOOR
from kmn_perception.evaluation.doors.label import DoorLabel, Edge, Known
from kmn_perception.evaluation.doors.settings import DoorErrorSettings
from kmn_perception.model.room_model import RoomModel

SETTINGS = DoorErrorSettings.load()
MODEL = RoomModel.load("room_door")
HEIGHT = 1.2  # of the camera, metres, which looks along x
POSE = np.array([[0, 0, 1, 0], [-1, 0, 0, 0], [0, -1, 0, HEIGHT], [0, 0, 0, 1]], dtype=float)
WIDTH, TOP, FRONT, AWAY = 0.9, 2.1, 0.019, 2.0
# A closed panel 2 m ahead, 0.9 m wide, 2.1 m high, handle at the right 85 mm from the edge.
TRUTH = {"x": AWAY + FRONT, "door_height": 0.1, "door_width": 0.1, "handle_y": -0.01}
HANDLE = np.array([WIDTH / 2 - 0.085, HEIGHT - 1.05, AWAY - 0.051])


def _edge(right: float, deviation: float) -> Edge:
    top, bottom = (np.array([right, HEIGHT - z, AWAY]) for z in (TOP, 0.0))
    return Edge(top, bottom, deviation, visible=True)


LABEL = DoorLabel(
    normal=np.array([0.0, 0.0, -1.0]),
    up=np.array([0.0, -1.0, 0.0]),
    right=np.array([1.0, 0.0, 0.0]),
    centre=np.array([0.0, HEIGHT - TOP / 2, AWAY]),
    yaw_deviation=0.1,
    distance_deviation=0.004,
    edges=(_edge(-WIDTH / 2, 0.012), _edge(WIDTH / 2, 0.0)),
    width=Known(WIDTH, 0.008),
    top=Known(TOP, 0.0),
    handle=HANDLE,
    handle_deviation=np.array([0.003, 0.0, 0.02]),
    handle_side="right",
    opening=Known(0.0, 0.0),
    camera_pose=POSE,
    panel=np.empty((0, 2)),
)


def estimate_of(deviations: dict[str, float] | None = None, **values: float) -> DoorEstimate:
    """Return the estimate of a door with standard deviations and values other than the truth."""
    known = {**TRUTH, **values}
    variances = [(deviations or {}).get(name, 0.0) ** 2 for name in DOOR]
    return replace(
        DoorEstimate.none("", DoorStatus.OK),
        values=np.array([known.get(name, 0.0) for name in DOOR]),
        covariance=np.diag(variances),
        handle_side="right",
        camera_pose=POSE,
    )
