"""Where the camera of a frame stands in the world."""

from __future__ import annotations

from enum import Enum

import numpy as np
from numpy.typing import NDArray

from kmn_perception.scene.depth_view import DepthView
from kmn_perception.scene.support_plane import SupportPlaneSettings, find_support_plane, pose_above

ROLLS = {  # how a camera may be mounted: x and y of its optical frame when it is upright
    "is upside down": ((-1.0, 0.0), (0.0, -1.0)),
    "lies on its left side (portrait)": ((0.0, 1.0), (-1.0, 0.0)),
    "lies on its right side (portrait)": ((0.0, -1.0), (1.0, 0.0)),
}


class CameraPose(str, Enum):
    """Where the pose of the camera in the world comes from.

    With ``AUTO`` it is that of the view where it has one, else the canonical one.
    """

    AUTO = "auto"
    TF = "tf"
    CANONICAL = "canonical"
    GIVEN = "given"
    SUPPORT_PLANE = "support_plane"


class NoCameraPoseError(ValueError):
    """The camera's pose cannot be found; the text says why."""


def find_camera_pose(
    view: DepthView,
    source: CameraPose,
    given: NDArray[np.float64],
    canonical: NDArray[np.float64] | None,
    plane_settings: SupportPlaneSettings,
) -> NDArray[np.float64]:
    """Return the pose (4, 4) of the optical frame in the world frame.

    Parameters
    ----------
    given, canonical
        (4, 4) the user's pose, and that of the model's canonical camera; ``None`` where several
        models have different ones.

    Raises
    ------
    NoCameraPoseError
        If it is to be found from the support plane, and there is none, or if it needs a canonical
        camera, and there is none.
    """
    if view.pose is not None and not view.in_world:
        return view.pose
    if source is CameraPose.GIVEN and not view.in_world:
        return given
    if canonical is None:
        raise NoCameraPoseError(
            "the models have different canonical cameras: the pose of the camera must be given or "
            "come from transforms, and points be in the camera's frame"
        )
    if view.in_world or source is not CameraPose.SUPPORT_PLANE:
        return canonical
    plane = find_support_plane(view.points, plane_settings)
    if plane is None:
        raise NoCameraPoseError(_why_no_plane(view.points, plane_settings))
    return pose_above(plane, canonical)


def _why_no_plane(points: NDArray[np.float32], settings: SupportPlaneSettings) -> str:
    reason = (
        f"no support plane: no plane within {np.degrees(settings.max_tilt):.0f} deg of level "
        f"holds {100 * settings.min_fraction:.0f} % of the points"
    )
    for mounting, axes in ROLLS.items():
        upright = np.eye(3, dtype=np.float32)
        upright[:2, :2] = axes
        if find_support_plane(points @ upright.T, settings) is not None:
            return f"{reason}, but one does in the turned image: the camera {mounting}"
    return reason
