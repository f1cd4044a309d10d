"""Frames of one camera, fused where it is known that they belong together."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from kmn_perception.doors.door_estimate import DoorEstimate
from kmn_perception.doors.fusion import DoorFusion
from kmn_perception.doors.resting import RestingCamera
from kmn_perception.doors.settings import DoorSettings
from kmn_perception.doors.walls import Frame


class FrameFusion:
    """Fuses doors as long as the camera's pose is known, or as it rests.

    Parameters
    ----------
    frames
        How many are fused at most.
    """

    def __init__(self, frames: int) -> None:
        settings = DoorSettings.load().fusion
        self._doors = DoorFusion(frames, settings)
        self._camera = RestingCamera(settings.resting)
        self._was_known = False

    def add(
        self, found: DoorEstimate, frame: Frame, pose: NDArray[np.float64] | None
    ) -> DoorEstimate:
        """Return what this and the frames before tell of the door.

        Parameters
        ----------
        pose
            (4, 4) of the camera in the world; None if it is not known.
        """
        is_known = pose is not None
        rests = is_known or self._camera.rests(frame)
        if is_known is not self._was_known or not rests:
            self._doors.restart()
        self._was_known = is_known
        return self._doors.add(found if pose is None else found.in_world(pose))
