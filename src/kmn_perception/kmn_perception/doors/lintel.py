"""The top of a door: a level edge between its upright ones."""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from kmn_perception.doors.candidates import Candidate
from kmn_perception.doors.lines import gaussian_steps, largest_near
from kmn_perception.doors.part_settings import LintelSettings
from kmn_perception.doors.view_cells import cell_of, row_of
from kmn_perception.doors.wall_view import WallView

_PIECE = 0.1  # metres
_SMOOTHING = 2.0  # pixels of the view


class Lintel(NamedTuple):
    """What is known of the top.

    Attributes
    ----------
    z
        Height of the edge above the floor in the view, metres; None where no edge was found.
    deviation
        Its standard deviation, metres, other edges that may be the top included.
    seen_to
        Height up to which an edge would have been seen, metres; 0 where depth alone shows none.
    """

    z: float | None
    deviation: float
    seen_to: float


def find_lintel(
    candidate: Candidate, heights: tuple[float, float], settings: LintelSettings
) -> Lintel:
    """Find the level edge above a door.

    Parameters
    ----------
    candidate
        The door's edges; where a network saw them, it also tells which heights are likely.
    heights
        Between which it is sought in the view, metres above the floor.
    """
    view, left, right = candidate.view, candidate.left.column, candidate.right.column
    inner = slice(left + 6, max(right - 6, left + 7))
    inside = view.inside[:, inner]
    enough = np.flatnonzero(inside.mean(axis=1) > 0.5)
    seen_to = float(view.z[enough[0]]) if len(enough) else 0.0
    if view.grey is None:
        return Lintel(None, np.inf, 0.0)
    low, high = heights
    reach = round(settings.beside[1] / float(view.s[1] - view.s[0]))
    steps = _steps(view, slice(max(left - reach, 0), right + reach + 1))
    contrast, coverage = _rows(view, steps, inner, settings)
    likely = _likely(candidate)
    if likely is not None and likely[-1] > 0.5:
        return Lintel(None, np.inf, seen_to)
    evidence = np.where((view.z > low) & (view.z < high) & coverage, np.abs(contrast), 0.0)
    passing = _passing(view, steps, (left, right), contrast, settings.beside)
    evidence = evidence * (1.0 - settings.passing * passing)
    if likely is not None:
        evidence = evidence * (likely[:-1] + settings.unlikely)
    rows = evidence.astype(np.float32)
    peaks = np.flatnonzero((rows > 0.0) & (rows >= largest_near(rows)))
    if seen_to < low or not len(peaks):
        return Lintel(*_by_network(view, likely, settings), seen_to)
    best = peaks[rows[peaks].argmax()]
    weights = rows[peaks].astype(np.float64) ** 2
    spread = np.average((view.z[peaks] - view.z[best]) ** 2, weights=weights)
    return Lintel(float(view.z[best]), float(np.hypot(settings.noise, np.sqrt(spread))), seen_to)


def usual_top(seen_to: float, usual: tuple[float, float], missed: float) -> tuple[float, float]:
    """Return height and standard deviation of a top that was not found, metres.

    Parameters
    ----------
    seen_to
        Up to which it would have been seen.
    usual
        Mean and deviation of all tops.
    missed
        How likely one that is in view is not found.
    """
    mean, deviation = usual
    grid = mean + deviation * np.linspace(-3.0, 3.0, 200)
    weights = np.exp(-0.5 * ((grid - mean) / deviation) ** 2)
    weights[grid < seen_to] *= missed
    value = float(np.average(grid, weights=weights))
    return value, float(np.sqrt(np.average((grid - value) ** 2, weights=weights)))


def _by_network(
    view: WallView, likely: NDArray[np.float64] | None, settings: LintelSettings
) -> tuple[float | None, float]:
    """Return a top that the network alone sees, if it is sure of it, and its deviation."""
    if likely is None or likely[:-1].max() < settings.sure:
        return None, np.inf
    return float(
        np.average(view.z, weights=likely[:-1] >= 0.9 * likely[:-1].max())
    ), settings.hint_noise


def _likely(candidate: Candidate) -> NDArray[np.float64] | None:
    """Return what the network thinks of each row of the view as the top; the last: not in view."""
    if candidate.proposals is None:
        return None
    view = candidate.view
    first, last = (round(cell_of(view, line.column)) for line in (candidate.left, candidate.right))
    probabilities = candidate.proposals.top_over(max(first, 0), last)
    cells = np.convolve(probabilities[:-1], np.ones(3), mode="same")  # with its neighbours
    at = np.clip(np.rint(row_of(view, np.arange(len(view.z)))), 0, len(cells) - 1).astype(np.int64)
    return np.append(cells[at], probabilities[-1])


def _steps(view: WallView, columns: slice) -> NDArray[np.float32]:
    """Return the steps (rows, columns) of grey downwards; 0 in other columns."""
    assert view.grey is not None
    steps = np.zeros_like(view.grey)
    shade = np.where(view.inside[:, columns], view.grey[:, columns], np.float32(0.0))
    steps[:, columns] = gaussian_steps(shade, _SMOOTHING, axis=0)
    return steps


def _rows(
    view: WallView, steps: NDArray[np.float32], inner: slice, settings: LintelSettings
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Return each row's step of grey, and whether enough of the width shows it."""
    inside, steps = view.inside[:, inner], steps[:, inner]
    known = cv2.erode(inside.astype(np.uint8), np.ones((13, 1), np.uint8)) > 0
    size = max(1, round(_PIECE / abs(float(view.s[1] - view.s[0]))))
    count = steps.shape[1] // size
    shape = (len(view.z), count, size)
    number = known[:, : count * size].reshape(shape).sum(axis=2)
    pieces = (steps * known)[:, : count * size].reshape(shape).sum(axis=2) / np.maximum(number, 1)
    told = number > 0.5 * size
    visible = np.maximum(told.sum(axis=1), 1)
    best: NDArray[np.float64] = np.zeros(len(view.z))
    enough = np.zeros(len(view.z), dtype=np.bool_)
    for sign in (1.0, -1.0):
        near = cv2.dilate((sign * pieces).astype(np.float32), np.ones((5, 1), np.uint8))
        hits = ((near > settings.min_contrast) & told).sum(axis=1)
        contrast = np.where(told, np.clip(sign * pieces, -1.0, 1.0), 0.0).sum(axis=1) / visible
        good = (hits >= settings.min_coverage * visible) & (hits >= settings.min_width * count)
        best = np.where(good & (contrast > np.abs(best)), sign * contrast, best)
        enough |= good
    return best, enough


def _passing(
    view: WallView,
    steps: NDArray[np.float32],
    edges: tuple[int, int],
    contrast: NDArray[np.float64],
    beside: tuple[float, float],
) -> NDArray[np.float64]:
    """Return how much (0 to 1) of each row's step goes on beyond both upright edges.

    The panel's top ends at its edges, that of a frame at the frame's.

    Parameters
    ----------
    beside
        Distances from the edges between which it is looked for, metres.
    """
    pixel = float(view.s[1] - view.s[0])
    near, far = (max(1, round(distance / pixel)) for distance in beside)
    left, right = edges
    share = np.ones(len(view.z))
    for strip in (slice(max(left - far, 0), max(left - near, 0)), slice(right + near, right + far)):
        if view.inside[:, strip].shape[1] == 0:
            return np.zeros(len(view.z))
        step = (steps[:, strip].mean(axis=1) * np.sign(contrast)).astype(np.float32)
        step = cv2.dilate(step[:, None], np.ones((5, 1), np.uint8))[:, 0]  # may be aslant
        seen = view.inside[:, strip].all(axis=1)
        share = np.minimum(share, seen * step / np.maximum(np.abs(contrast), 1e-6))
    return np.clip(share, 0.0, 1.0)
