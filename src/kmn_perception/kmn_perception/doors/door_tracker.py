"""The frames of one camera: a door is looked for where it was while nothing moves, and fused."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from kmn_perception.doors.door_estimate import DoorEstimate
from kmn_perception.doors.door_finder import DoorFinder, Sighting
from kmn_perception.doors.frame_fusion import FrameFusion
from kmn_perception.doors.fusion import is_same_door
from kmn_perception.doors.resting import RestingCamera
from kmn_perception.doors.settings import DoorSettings
from kmn_perception.doors.walls import Frame

_SECOND = 10**9  # ns


class DoorTracker:
    """Finds doors in frame after frame.

    Every frame is measured; only the search for what to measure is left out while the camera rests
    and the door shows where it was. It begins to be left out once some searches in a row have
    agreed, since by chance one may be sure of what others doubt, and it is made anew after a time,
    since else a door that became likelier would never be found.

    Parameters
    ----------
    frames
        How many are fused at most; 1: none are.
    """

    def __init__(self, frames: int) -> None:
        settings = DoorSettings.load()
        self._settings = settings.tracking
        self._camera = RestingCamera(settings.fusion.resting)
        self._fusion = FrameFusion(frames) if frames > 1 else None
        self._last: Sighting | None = None
        self._agreed = 0  # searches in a row
        self._searched = 0  # ns, stamp of that sighting

    def find(
        self, finder: DoorFinder, frame: Frame, pose: NDArray[np.float64] | None, stamp: int
    ) -> DoorEstimate:
        """Return what this frame, and those before, tell of the door.

        Parameters
        ----------
        pose
            (4, 4) of the camera in the world; None if it is not known.
        stamp
            Of the exposure, nanoseconds; 0 if it is not known: then the search is a whole one.
        """
        rests = self._camera.rests(frame)
        found = self._look_again(finder, frame, stamp) if rests else None
        if found is None:
            found = self._search(finder, frame, stamp, rests)
        return found if self._fusion is None else self._fusion.add(found, pose, rests)

    def _look_again(self, finder: DoorFinder, frame: Frame, stamp: int) -> DoorEstimate | None:
        """Measure the door where it was, unless the search is due."""
        is_recent = 0 <= stamp - self._searched < self._settings.period * _SECOND
        if (
            self._last is None
            or self._agreed < self._settings.searches
            or not (stamp and is_recent)
        ):
            return None
        return finder.look_again(frame, self._last)

    def _search(self, finder: DoorFinder, frame: Frame, stamp: int, rests: bool) -> DoorEstimate:
        before, self._last, self._searched = self._last, finder.search(frame), stamp
        found = self._last.estimate
        is_same = (
            rests
            and before is not None
            and is_same_door(found, before.estimate, self._settings.disagree)
        )
        self._agreed = self._agreed + 1 if is_same else 1
        return found
