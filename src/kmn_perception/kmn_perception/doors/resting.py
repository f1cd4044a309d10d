"""Whether a camera rests: the lines of its image stay where they are, and so do the depths."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from kmn_perception.doors.fusion_settings import RestSettings
from kmn_perception.doors.walls import Frame

_DARK = 1e-3  # of 1


class RestingCamera:
    """Compares each frame with the one in which the camera came to rest.

    A comparison with the frame before would not see a camera that moves slowly. Depth alone does
    not prove rest either: a wall looks the same from any place along it.
    """

    def __init__(self, settings: RestSettings) -> None:
        self._settings = settings
        self._first: Frame | None = None

    def rests(self, frame: Frame) -> bool:
        """Return whether the camera has not moved; else later frames are compared with this one."""
        first = self._first
        if (
            first is not None
            and first.depth.shape == frame.depth.shape
            and self._same_lines(first.grey, frame.grey)
            and self._same_depth(first, frame)
        ):
            return True
        self._first = frame
        return False

    def _same_lines(
        self, before: NDArray[np.float32] | None, now: NDArray[np.float32] | None
    ) -> bool:
        """Return whether lines (upright ones there must be) are where they were.

        The shift across a line is the change of grey by its slope, and most lines tell that of the
        camera: the median does not care for who walks by.
        """
        if before is None or now is None:
            return False
        settings = self._settings
        a, b = (
            np.asarray(cv2.GaussianBlur(grey, (0, 0), settings.blur), np.float32)
            for grey in (before, now)
        )
        change = b * float(np.median((a / np.maximum(b, _DARK))[::4, ::4])) - a
        for (right, down), needed in (((1, 0), True), ((0, 1), False)):
            slope = np.asarray(cv2.Sobel(a, cv2.CV_32F, right, down, scale=0.125))
            lines = np.abs(slope) > settings.slope
            if lines.sum() < settings.pixels:
                if needed:
                    return False
                continue
            if np.median(np.abs(change[lines] / slope[lines])) > settings.shift:
                return False
        return True

    def _same_depth(self, before: Frame, now: Frame) -> bool:
        both = (before.depth > 0.0) & (now.depth > 0.0)
        if not both.any():
            return False
        change = 1.0 / now.depth[both] - 1.0 / before.depth[both]
        return bool(abs(np.median(change)) < self._settings.inverse_depth)
