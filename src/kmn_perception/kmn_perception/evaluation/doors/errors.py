"""Errors of an estimated door: estimate minus label, along the label's own axes."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kmn_perception.doors.door_estimate import DoorEstimate
from kmn_perception.doors.geometry import DOOR, HEIGHT, WIDTH, propagate
from kmn_perception.evaluation.doors.label import DoorLabel, Edge
from kmn_perception.evaluation.doors.settings import DoorErrorSettings
from kmn_perception.model.room_model import RoomModel

MM = 1e3  # in a metre
# What is compared, and its unit. `distance` is that of the panel's plane at the label's centre.
UNITS = {
    "left": "mm", "right": "mm", "distance": "mm", "yaw": "deg", "width": "mm", "top": "mm",
    "handle_up": "mm", "handle_along": "mm", "opening": "deg",
}  # fmt: skip
EDGES = slice(0, 2)
YAW = list(UNITS).index("yaw")

CLOSED = 2.0  # degrees of opening, below which nobody calls a door ajar


class DoorPlace(NamedTuple):
    """What is compared of a door, in the optical frame, metres.

    Attributes
    ----------
    left, right
        (2, 3) top and bottom of the edges of the panel's front.
    normal
        (3,) of the panel as it stands.
    width, top
        Of the panel, and of its top above the floor; NaN if they are not told.
    handle
        (3,) its middle; NaN without one.
    opening
        Degrees, of any sign.
    """

    left: NDArray[np.float64]
    right: NDArray[np.float64]
    normal: NDArray[np.float64]
    width: float
    top: float = np.nan
    handle: NDArray[np.float64] = np.full(3, np.nan)
    opening: float = np.nan


class DoorErrors(NamedTuple):
    """Errors (Q,) in the order and the units of ``UNITS``; NaN where nothing is compared.

    Attributes
    ----------
    values
        Estimate minus label.
    stated
        Standard deviations that the estimate states; NaN of a method that states none.
    deviations
        The same together with the label's.
    """

    values: NDArray[np.float64]
    stated: NDArray[np.float64]
    deviations: NDArray[np.float64]

    @property
    def ratios(self) -> NDArray[np.float64]:
        """(Q,) errors in deviations, without their signs."""
        with np.errstate(divide="ignore", invalid="ignore"):  # what is stated to be exact
            return np.abs(self.values) / self.deviations

    def far_off(self, settings: DoorErrorSettings) -> tuple[str, ...]:
        """Return the edges and the yaw that are not where they are said to be."""
        limits = np.full(len(UNITS), np.inf)
        limits[EDGES], limits[YAW] = MM * settings.wrong_edge, settings.wrong_yaw
        return _names(np.abs(self.values) > limits)

    def broken_promises(self, settings: DoorErrorSettings) -> tuple[str, ...]:
        """Return the quantities whose errors are larger than their deviations allow."""
        return _names(self.ratios > settings.wrong_deviations)

    def is_wrong(self, settings: DoorErrorSettings) -> bool:
        """Return whether a promise is broken, or the door is not where it is said to be."""
        return bool(self.far_off(settings) or self.broken_promises(settings))


def _names(which: NDArray[np.bool_]) -> tuple[str, ...]:
    return tuple(name for name, is_so in zip(UNITS, which, strict=True) if is_so)


def errors(
    estimate: DoorEstimate, label: DoorLabel, model: RoomModel, settings: DoorErrorSettings
) -> DoorErrors:
    """Compare an estimate with a label; deviations follow from its covariance by derivatives."""

    def compared(values: NDArray[np.float64]) -> NDArray[np.float64]:
        places = [
            door_place(door, estimate.latch_side, estimate.camera_pose, model) for door in values
        ]
        if not estimate.handle_side:
            places = [place._replace(handle=np.full(3, np.nan)) for place in places]
        return np.stack([compare(place, label) for place in places])

    found, covariance = propagate(compared, estimate.values, estimate.covariance)
    stated = np.sqrt(np.diag(covariance))
    return DoorErrors(found, stated, np.hypot(stated, label_deviations(label, settings)))


def door_place(
    values: NDArray[np.float64],
    side: str,
    camera_pose: NDArray[np.float64],
    model: RoomModel,
) -> DoorPlace:
    """Return where the door of parameters (9,), see `DOOR`, is seen from a camera.

    Parameters
    ----------
    side
        ``left`` or ``right`` as seen, of latch and handle.
    camera_pose
        (4, 4) optical frame in the world of the parameters.
    """
    mirror = -1.0 if side == "left" else 1.0
    opening = float(values[DOOR.index("opening")])
    gamma = model.model.split(values[:7])[1]
    body = model.model.body("panel")
    centre, size = body.centre(gamma), body.size(gamma)
    pose = np.linalg.inv(camera_pose) @ model.pose(values[:7], side, opening)

    def to_camera(point: NDArray[np.float64]) -> NDArray[np.float64]:
        seen: NDArray[np.float64] = pose[:3, :3] @ point + pose[:3, 3]
        return seen

    left, right = (
        np.array([to_camera(centre + size * [-0.5, y, z]) for z in (0.5, -0.5)])
        for y in (0.5 * mirror, -0.5 * mirror)
    )
    handle = to_camera(model.model.body("handle").centre(gamma))
    return DoorPlace(
        left,
        right,
        normal=-pose[:3, 0],
        width=WIDTH + float(values[DOOR.index("door_width")]),
        top=HEIGHT + float(values[DOOR.index("door_height")]),
        handle=handle,
        opening=float(np.degrees(opening)),
    )


def compare(found: DoorPlace, label: DoorLabel) -> NDArray[np.float64]:
    """Return the errors (Q,) of a door, NaN where one of both does not know a quantity."""
    normal, up, right = label.normal, label.up, label.right
    middle = np.mean([*found.left, *found.right], axis=0)
    turn = float(np.cross(normal, found.normal) @ up)
    offset = (middle - label.centre) @ found.normal / (normal @ found.normal)
    nothing = np.full(3, np.nan)
    handle = found.handle - (nothing if label.handle is None else label.handle)
    opening = abs(found.opening) - (label.opening.value if label.opening else np.nan)
    is_closed = label.opening is not None and max(abs(found.opening), label.opening.value) < CLOSED
    sides = zip((found.left, found.right), label.edges, strict=True)
    return np.array(
        [
            *(MM * _across(ends, edge, label) for ends, edge in sides),
            MM * offset,
            np.degrees(np.arcsin(np.clip(turn, -1.0, 1.0))),
            MM * (found.width - (label.width.value if label.width else np.nan)),
            MM * (found.top - (label.top.value if label.top else np.nan)),
            MM * (handle @ up),
            MM * (handle @ right),
            np.nan if is_closed else opening,  # two closed doors say nothing of the accuracy
        ]
    )


def _across(ends: NDArray[np.float64], edge: Edge | None, label: DoorLabel) -> float:
    """Return by how much an edge's ends (2, 3) are too far to the right, metres, on average."""
    if edge is None:
        return np.nan
    along = (edge.top - edge.bottom) / ((edge.top - edge.bottom) @ label.up)
    feet = edge.bottom + ((ends - edge.bottom) @ label.up)[:, None] * along
    return float(((ends - feet) @ label.right).mean())


def label_deviations(label: DoorLabel, settings: DoorErrorSettings) -> NDArray[np.float64]:
    """Return the standard deviations (Q,) of the label, in the units of ``UNITS``."""
    handle = [
        MM * float(np.linalg.norm(label.handle_deviation * axis))
        for axis in (label.up, label.right)
    ]
    return np.array(
        [
            *(MM * edge.deviation if edge else 0.0 for edge in label.edges),
            MM * label.distance_deviation,
            label.yaw_deviation,
            MM * (label.width.deviation if label.width else 0.0),
            MM * (label.top.deviation if label.top else 0.0),
            *handle,
            max(label.opening.deviation if label.opening else 0.0, settings.opening_deviation),
        ]
    )
