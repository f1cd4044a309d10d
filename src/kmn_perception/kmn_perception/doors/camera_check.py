"""Whether what is seen agrees with what is said of the camera, and with an upright one."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from kmn_perception.doors.door_estimate import DoorEstimate
from kmn_perception.doors.planes import Plane
from kmn_perception.doors.settings import DoorSettings
from kmn_perception.doors.upright import SeenHeight

_ABOVE_DOOR = 0.2, 2.0  # metres by which a ceiling is above a door's top


def find_contradiction(
    planes: Sequence[Plane],
    up: NDArray[np.float64],
    height: float | None,
    settings: DoorSettings,
) -> str:
    """Return how the level surfaces in view contradict a camera's pose, or nothing.

    Parameters
    ----------
    up, height
        The upward vector (3,) in the optical frame and the height above the floor, metres, by the
        camera's pose.
    """
    below = _level(planes, up, settings)
    tilt = min((_angle(plane.normal, up) for plane in below), default=0.0)
    if tilt > settings.vertical.search:
        return (
            f"the floor in view is tilted by {np.degrees(tilt):.0f} deg against the pose that was "
            "given for the camera"
        )
    if height is None:
        return ""
    near = settings.floor.max_deviation * height
    above = _level(planes, -up, settings)
    if not below and any(abs(plane.distance - height) < near for plane in above):
        return (
            f"no floor is in view, but a level surface {height:.2f} m above the camera, as far as "
            "the floor should be below: the camera may be upside down"
        )
    return ""


def doubt_height(height: float, seen: SeenHeight, settings: DoorSettings) -> str:
    """Return how the floor in view contradicts the camera's height that is given, metres."""
    calibration = settings.calibration
    expected = np.hypot(calibration.offset, calibration.floor) * seen.gain
    allowed = settings.floor.contradiction * np.hypot(settings.fit.given_height, expected)
    if abs(seen.metres - height) <= allowed:
        return ""
    return (
        f"the floor in view is {seen.metres:.2f} m below the camera, by the pose that was given "
        f"for it {height:.2f} m"
    )


def doubt_tilt(up: NDArray[np.float64], seen: NDArray[np.float64], settings: DoorSettings) -> str:
    """Return how the vertical lines of an image contradict the upward vector that is given."""
    tilt = _angle(up, seen)
    if tilt <= settings.vertical.max_tilt_error:
        return ""
    return (
        f"the vertical lines in the image are tilted by {np.degrees(tilt):.1f} deg against the "
        "pose that was given for the camera"
    )


def doubt_upright(
    found: DoorEstimate, planes: Sequence[Plane], up: NDArray[np.float64], settings: DoorSettings
) -> str:
    """Return why a camera of which nothing is known may be upside down, or nothing.

    A door is much the same when it is turned over, but then a floor meets its top, and a ceiling
    does not; nor is a camera as far above a floor as it may be below a ceiling.
    """
    top, (low, high) = float(np.max(found.corners[:2] @ up)), _ABOVE_DOOR
    by_height = bool(_level(planes, up, settings) or found.handle_side)  # else by its own edge
    for plane in _level(planes, -up, settings):
        if plane.distance > settings.floor.heights[1]:
            continue
        is_ceiling = low < plane.distance - top < high
        if not is_ceiling or not (found.top_is_seen or by_height):
            return (
                f"a level surface is {plane.distance:.2f} m above the camera: it may be the floor, "
                "and the camera upside down; expected an upright image or the camera's pose"
            )
    return ""


def _level(planes: Sequence[Plane], up: NDArray[np.float64], settings: DoorSettings) -> list[Plane]:
    """Return the planes whose normals are nearly an upward vector."""
    return [p for p in planes if _angle(p.normal, up) < settings.vertical.max_floor_tilt]


def _angle(a: NDArray[np.float64], b: NDArray[np.float64]) -> float:
    return float(np.arccos(np.clip(a @ b, -1.0, 1.0)))
