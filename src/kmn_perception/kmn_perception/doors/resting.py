"""Whether a camera rests: the lines of its image stay where they are, and so do the depths."""

from __future__ import annotations

from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from kmn_perception.doors.fusion_settings import RestSettings
from kmn_perception.doors.walls import Frame

_DARK = 1e-3  # of 1
_ENOUGH = 4000  # pixels for a median
_SOME = slice(None, None, 4)  # of the rows and columns, where there are more than a median needs


class RestingCamera:
    """Compares each frame with the one in which the camera came to rest.

    A comparison with the frame before would not see a camera that moves slowly. Depth alone does
    not prove rest either: a wall looks the same from any place along it.
    """

    def __init__(self, settings: RestSettings) -> None:
        self._settings = settings
        self._first: _Still | None = None

    def rests(self, frame: Frame) -> bool:
        """Return whether the camera has not moved; else later frames are compared with this one."""
        now = _Still(frame, self._settings)
        if self._first is not None and self._first.is_like(now):
            return True
        self._first = now
        return False


class _Still:
    """A frame with what tells a moved camera; computed as it is needed."""

    def __init__(self, frame: Frame, settings: RestSettings) -> None:
        self._frame, self._settings = frame, settings

    def is_like(self, now: _Still) -> bool:
        """Return whether another frame shows the same lines and depths."""
        same_size = self._frame.depth.shape == now._frame.depth.shape
        return same_size and self._same_lines(now) and self._same_depth(now)

    @cached_property
    def _grey(self) -> NDArray[np.float32]:
        """(height, width) blurred."""
        assert self._frame.grey is not None
        blurred = cv2.GaussianBlur(self._frame.grey, (0, 0), self._settings.blur)
        return np.asarray(blurred, np.float32)

    @cached_property
    def _lines(self) -> list[tuple[NDArray[np.intp], NDArray[np.float32]]]:
        """Pixels (N,) of upright and of level lines, and the slopes of grey there, 1/pixel."""
        found = []
        for right, down in ((1, 0), (0, 1)):
            sobel = cv2.Sobel(self._grey, cv2.CV_32F, right, down, scale=0.125)
            slope = np.asarray(sobel, np.float32).ravel()
            pixels = np.flatnonzero(np.abs(slope) > self._settings.slope)
            pixels = pixels[:: max(1, len(pixels) // _ENOUGH)]
            found.append((pixels, slope[pixels]))
        return found

    def _same_lines(self, now: _Still) -> bool:
        """Return whether lines (upright ones there must be) are where they were.

        The shift across a line is the change of grey by its slope, and most lines tell that of the
        camera: the median does not care for who walks by.
        """
        if self._frame.grey is None or now._frame.grey is None:
            return False
        a, b = self._grey, now._grey
        gain = float(np.median(a[_SOME, _SOME] / np.maximum(b[_SOME, _SOME], _DARK)))
        upright, level = self._lines
        for (pixels, slope), needed in ((upright, True), (level, False)):
            if len(pixels) < self._settings.pixels:
                if needed:
                    return False
                continue
            shift = (b.ravel()[pixels] * gain - a.ravel()[pixels]) / slope
            if np.median(np.abs(shift)) > self._settings.shift:
                return False
        return True

    def _same_depth(self, now: _Still) -> bool:
        before, after = (still._frame.depth[_SOME, _SOME] for still in (self, now))
        both = (before > 0.0) & (after > 0.0)
        if not both.any():
            return False
        change = 1.0 / after[both] - 1.0 / before[both]
        return bool(abs(np.median(change)) < self._settings.inverse_depth)
