"""Frames of one camera, fused where it is known that they belong together."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from kmn_perception.doors.door_estimate import DoorEstimate
from kmn_perception.doors.fusion import DoorFusion
from kmn_perception.doors.settings import DoorSettings


class FrameFusion:
    """Fuses doors as long as the camera's pose is known, or as it rests.

    Parameters
    ----------
    frames
        How many are fused at most.
    """

    def __init__(self, frames: int) -> None:
        self._doors = DoorFusion(frames, DoorSettings.load().fusion)
        self._was_known = False

    def add(
        self, found: DoorEstimate, pose: NDArray[np.float64] | None, rests: bool
    ) -> DoorEstimate:
        """Return what this and the frames before tell of the door.

        Parameters
        ----------
        pose
            (4, 4) of the camera in the world; None if it is not known.
        rests
            Whether the camera has not moved since the frame before.
        """
        is_known = pose is not None
        if is_known is not self._was_known or not (is_known or rests):
            self._doors.restart()
        self._was_known = is_known
        return self._doors.add(found if pose is None else found.in_world(pose))
