"""The top of a door: a level edge between its upright ones."""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np

from kmn_perception.doors.lines import gaussian_steps
from kmn_perception.doors.settings import LintelSettings
from kmn_perception.doors.wall_view import WallView

_PIECE = 0.1  # metres
_SMOOTHING = 2.0  # pixels of the view
_SEEN = 0.45  # of the width that a top must be seen in; a poster is narrower


class Lintel(NamedTuple):
    """What is known of the top.

    Attributes
    ----------
    z
        Height of the edge above the floor, metres; None where no edge was found.
    seen_to
        Height up to which an edge would have been seen, metres; 0 where depth alone shows none.
    """

    z: float | None
    seen_to: float


def find_lintel(
    view: WallView,
    left: int,
    right: int,
    heights: tuple[float, float],
    settings: LintelSettings,
) -> Lintel:
    """Find the level edge above a door between two columns of its wall's view.

    Parameters
    ----------
    heights
        Between which it is sought in the view, metres above the floor.
    """
    inner = slice(left + 6, max(right - 6, left + 7))
    inside = view.inside[:, inner]
    enough = np.flatnonzero(inside.mean(axis=1) > 0.5)
    seen_to = float(view.z[enough[0]]) if len(enough) else 0.0
    low, high = heights
    if view.grey is None:
        return Lintel(None, 0.0)
    if seen_to < low:
        return Lintel(None, seen_to)
    shade = np.where(inside, view.grey[:, inner], np.float32(0.0))
    steps = gaussian_steps(np.ascontiguousarray(shade.T), _SMOOTHING).T
    known = cv2.erode(inside.astype(np.uint8), np.ones((13, 1), np.uint8)) > 0
    size = max(1, round(_PIECE / abs(float(view.s[1] - view.s[0]))))
    count = steps.shape[1] // size
    if count < 3:
        return Lintel(None, seen_to)
    shape = (len(view.z), count, size)
    number = known[:, : count * size].reshape(shape).sum(axis=2)
    pieces = (steps * known)[:, : count * size].reshape(shape).sum(axis=2) / np.maximum(number, 1)
    told = number > 0.5 * size
    best: tuple[float, float] | None = None
    for sign in (1.0, -1.0):
        near = cv2.dilate((sign * pieces).astype(np.float32), np.ones((5, 1), np.uint8))
        visible = np.maximum(told.sum(axis=1), 1)
        coverage = ((near > settings.min_contrast) & told).sum(axis=1) / visible
        contrast = (np.where(told, np.clip(sign * pieces, -1.0, 1.0), 0.0)).sum(axis=1) / visible
        rows = (view.z > low) & (view.z < high) & (coverage >= settings.min_coverage)
        rows &= ((near > settings.min_contrast) & told).sum(axis=1) >= _SEEN * count
        if rows.any():
            row = int(np.where(rows, contrast, -1.0).argmax())
            if best is None or contrast[row] > best[0]:
                best = float(contrast[row]), float(view.z[row])
    return Lintel(None if best is None else best[1], seen_to)
