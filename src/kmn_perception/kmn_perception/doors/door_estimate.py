"""What was found out about a door in its wall."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from kmn_perception.doors.geometry import DOOR


class DoorStatus(Enum):
    """What an estimate of a door is worth."""

    OK = "ok"
    HANDLE_NOT_SEEN = "handle not seen"  # the rest holds; where to look is the handle's place
    NO_DOOR = "no door"
    AMBIGUOUS = "ambiguous"


@dataclass(frozen=True, eq=False)
class DoorEstimate:
    """A door in its wall.

    Attributes
    ----------
    status, reason
        What it is worth, and why it is not OK.
    values, covariance
        (9,) and (9, 9) parameters of the door, see `DOOR`; NaN where there is none.
    handle_side, handle_kind
        ``left`` or ``right`` as seen; ``lever``, ``knob`` or ``bar``; empty where it is not seen,
        or not known.
    latch_side, hinge_is_known
        Side at which the parameters take the latch to be, and whether handle or opening tell it.
    camera_pose
        (4, 4) optical frame in the world, whose origin is on the floor below the camera.
    corners
        (4, 3) of the panel's front: top left, top right, bottom left, bottom right; optical frame.
    top_is_seen
        Whether the upper ones are where an edge was found, not where tops usually are.
    handle
        (3,) its middle, optical frame.
    normal
        (3,) of the panel, towards the camera, optical frame.
    disparity_offset
        Value and standard deviation of the sensor's error as this frame shows it, 1/m.
    score
        How much speaks for it.
    """

    status: DoorStatus
    reason: str
    values: NDArray[np.float64]
    covariance: NDArray[np.float64]
    handle_side: str
    handle_kind: str
    latch_side: str
    hinge_is_known: bool
    camera_pose: NDArray[np.float64]
    corners: NDArray[np.float64]
    top_is_seen: bool
    handle: NDArray[np.float64]
    normal: NDArray[np.float64]
    disparity_offset: tuple[float, float]
    score: float

    @classmethod
    def none(cls, reason: str, status: DoorStatus = DoorStatus.NO_DOOR) -> DoorEstimate:
        """Return the estimate that says why there is none."""
        n = len(DOOR)
        return cls(
            status=status,
            reason=reason,
            values=np.full(n, np.nan),
            covariance=np.full((n, n), np.nan),
            handle_side="",
            handle_kind="",
            latch_side="right",
            hinge_is_known=False,
            camera_pose=np.full((4, 4), np.nan),
            corners=np.full((4, 3), np.nan),
            top_is_seen=False,
            handle=np.full(3, np.nan),
            normal=np.full(3, np.nan),
            disparity_offset=(np.nan, np.nan),
            score=-np.inf,
        )

    def in_world(self, pose: NDArray[np.float64]) -> DoorEstimate:
        """Return the same door in the world in which the camera has a pose (4, 4).

        Both worlds have their floor at z = 0 and z up: they differ by a turn about z and a shift.
        """
        if not np.isfinite(self.values).all():
            return replace(self, camera_pose=pose)
        to_world = pose @ np.linalg.inv(self.camera_pose)
        heading = np.arctan2(to_world[1, 0], to_world[0, 0])
        c, s = np.cos(heading), np.sin(heading)
        turn = np.eye(len(DOOR))
        turn[:2, :2] = [[c, -s], [s, c]]
        values = turn @ self.values
        values[:2] += pose[:2, 3] - turn[:2, :2] @ self.camera_pose[:2, 3]
        values[2] = (values[2] + heading + np.pi) % (2.0 * np.pi) - np.pi
        covariance = turn @ self.covariance @ turn.T
        return replace(self, values=values, covariance=covariance, camera_pose=pose)

    @property
    def found(self) -> bool:
        """Whether there is a door, with or without its handle in sight."""
        return self.status in (DoorStatus.OK, DoorStatus.HANDLE_NOT_SEEN)

    def value(self, name: str) -> float:
        """Return a parameter by its name, see `DOOR`."""
        return float(self.values[DOOR.index(name)])

    def deviation(self, name: str) -> float:
        """Return its standard deviation."""
        i = DOOR.index(name)
        return float(np.sqrt(self.covariance[i, i]))
