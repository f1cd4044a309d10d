"""Upright edges in a wall's metric view: where grey or depth changes over a door's whole height."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import cv2
import numpy as np
from numba import njit
from numpy.typing import NDArray

from kmn_perception.doors.search_settings import LineSettings
from kmn_perception.doors.wall_view import WallView

CLIP = 1.5  # of gradients; a stronger one is no better an edge
_SPREAD = 9  # pixels by which what stands before the wall is widened


class Line(NamedTuple):
    """An upright edge.

    Attributes
    ----------
    column
        Of the view.
    sign
        1 where it is brighter (or nearer, if grey shows nothing) to the right, else -1.
    contrast
        Mean step of the logarithm of grey.
    coverage
        Share of the visible pieces that show it.
    step
        How much nearer it is to the left than to the right, inverse depth, in standard deviations.
    """

    column: int
    sign: int
    contrast: float
    coverage: float
    step: float


@dataclass(frozen=True, eq=False)
class Pieces:
    """The view's columns in pieces one above the other.

    Attributes
    ----------
    gradient
        (K, columns) mean step of the logarithm of grey to the right; 0 where it is not known.
    known
        (K, columns) pieces that are mostly in view and unhidden.
    hidden, hollow
        (columns,) shares of a door's height that something hides, and where nothing is for long
        behind.
    body
        (K,) pieces within the heights where any door has its edges.
    step
        (columns,) mean inverse depth to the left less that to the right, standard deviations.
    sharp
        (rows, columns) gradient of each pixel, and ``rows`` its pieces.
    rows
        (rows,) number of the piece, -1 outside.
    """

    gradient: NDArray[np.float32]
    known: NDArray[np.bool_]
    hidden: NDArray[np.float32]
    hollow: NDArray[np.float32]
    body: NDArray[np.bool_]
    step: NDArray[np.float64]
    sharp: NDArray[np.float32]
    rows: NDArray[np.int64]

    def shares_between(self, first: int, last: int) -> tuple[float, float]:
        """Return the mean shares that are hidden and hollow of columns first to last - 1."""
        hidden, hollow = (self._sums[:, last] - self._sums[:, first]) / (last - first)
        return float(hidden), float(hollow)

    @cached_property
    def _sums(self) -> NDArray[np.float64]:
        """(2, columns + 1) sums of hidden and hollow up to each column."""
        sums = np.cumsum([self.hidden, self.hollow], axis=1, dtype=np.float64)
        return np.pad(sums, ((0, 0), (1, 0)))


def cut_to_pieces(view: WallView, before: float, behind: float, settings: LineSettings) -> Pieces:
    """Take gradient and depth of a view's columns.

    Parameters
    ----------
    before, behind
        Offsets of the inverse depth, 1/m, from which something stands before the wall, and from
        which nothing is there.
    """
    low, high = settings.heights
    count = round((float(view.z[0]) - low) / settings.piece)
    rows = np.floor((view.z - low) / settings.piece).astype(np.int64)
    rows[(rows < 0) | (rows >= count)] = -1
    body = low + settings.piece * (np.arange(count) + 0.5) < high
    hides = view.offset > before
    hides = cv2.dilate(hides.astype(np.uint8), np.ones((_SPREAD, _SPREAD), np.uint8)) > 0
    hollow = view.offset < -behind
    usable = view.inside & ~hides
    if view.grey is None:
        sharp, known = np.zeros_like(view.offset), np.zeros_like(usable)
    else:
        sharp, known = _gradient(view.grey, usable, settings.smoothing)
    full = settings.piece / abs(float(view.z[1] - view.z[0]))
    area = np.maximum(row_sums(view.inside, rows, count), 1.0)
    number = row_sums(known, rows, count)
    return Pieces(
        gradient=np.where(
            number > 0.5 * full, row_sums(sharp, rows, count) / np.maximum(number, 1.0), 0.0
        ).astype(np.float32),
        known=number > 0.5 * full,
        hidden=(row_sums(hides & view.inside, rows, count) / area)[body].mean(axis=0),
        hollow=(row_sums(hollow & view.inside, rows, count) / area)[body].mean(axis=0),
        body=body,
        step=_steps(view, usable & ~hollow, rows, body, settings),
        sharp=sharp,
        rows=rows,
    )


def find_lines(pieces: Pieces, settings: LineSettings) -> list[Line]:
    """Find the upright edges of a view, from left to right."""
    body = pieces.body
    gradient, known = pieces.gradient[body], pieces.known[body]
    visible = known.sum(axis=0)
    noise = np.where(known.any(axis=1), 1.48 * _medians(np.abs(gradient), known), 1.0)
    least = np.maximum(settings.noise_factor * noise, settings.min_contrast)[:, None]
    found = []
    for sign in (1, -1):
        near = cv2.dilate(sign * gradient, np.ones((1, 5), np.uint8))  # may lean by a pixel or two
        coverage = ((near > least) & known).sum(axis=0) / np.maximum(visible, 1)
        contrast = np.where(known, np.clip(sign * gradient, -1.0, 1.0), 0.0).sum(axis=0)
        contrast = (contrast / np.maximum(visible, 1)).astype(np.float32)
        peak = (contrast >= largest_near(contrast)) & (contrast > 0.6 * settings.min_contrast)
        peak &= (visible >= settings.min_pieces) & (coverage >= settings.min_coverage)
        found += [
            Line(int(c), sign, float(contrast[c]), float(coverage[c]), float(pieces.step[c]))
            for c in np.flatnonzero(peak)
        ]
    found += _steps_without_grey(pieces, found, settings)
    return sorted(found)


def _medians(values: NDArray[np.float32], known: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Return the median (K,) of what is known in each row; infinite where nothing is."""
    ordered = np.sort(np.where(known, values, np.float32(np.inf)), axis=1)
    count = known.sum(axis=1)
    rows = np.arange(len(values))
    low, high = ordered[rows, np.maximum(count - 1, 0) // 2], ordered[rows, count // 2]
    return 0.5 * (low + high)


def _steps_without_grey(pieces: Pieces, lines: list[Line], settings: LineSettings) -> list[Line]:
    """Return the steps in depth beside which grey shows no edge."""
    size = np.abs(pieces.step).astype(np.float32)
    peak = (size >= largest_near(size, 25)) & (size > settings.min_step)
    taken = [line.column for line in lines]
    return [
        Line(int(c), int(-np.sign(pieces.step[c])), 0.0, 0.0, float(pieces.step[c]))
        for c in np.flatnonzero(peak)
        if not any(abs(c - other) <= 4 for other in taken)
    ]


def gaussian_steps(
    grey: NDArray[np.float32], smoothing: float, axis: int = 1
) -> NDArray[np.float32]:
    """Return the step about each pixel to the right (axis 1) or downwards (axis 0).

    It is a Gaussian's derivative, scaled to steps.
    """
    reach = int(np.ceil(3.0 * smoothing))
    x = np.arange(-reach, reach + 1)
    weights = x * np.exp(-0.5 * (x / smoothing) ** 2)
    weights *= smoothing * np.sqrt(2.0 * np.pi) / (weights * x).sum()
    along, across = weights.astype(np.float32), np.ones(1, np.float32)
    x_kernel, y_kernel = (along, across) if axis == 1 else (across, along)
    steps = cv2.sepFilter2D(grey, -1, x_kernel, y_kernel, borderType=cv2.BORDER_REPLICATE)
    return np.asarray(steps, dtype=np.float32)


def _gradient(
    grey: NDArray[np.float32], usable: NDArray[np.bool_], smoothing: float
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Return the steps of grey to the right, and where they are not beside what is unknown."""
    steps = gaussian_steps(np.where(usable, grey, np.float32(0.0)), smoothing)
    width = 2 * int(np.ceil(3.0 * smoothing)) + 1
    known = cv2.erode(usable.astype(np.uint8), np.ones((1, width), np.uint8)) > 0
    return np.clip(steps, -CLIP, CLIP) * known, known


def _steps(
    view: WallView,
    usable: NDArray[np.bool_],
    rows: NDArray[np.int64],
    body: NDArray[np.bool_],
    settings: LineSettings,
) -> NDArray[np.float64]:
    """Return by how much strips to the left are nearer than those to the right."""
    pixel = float(view.s[1] - view.s[0])
    strip, gap = (max(1, round(x / pixel)) for x in (settings.strip, settings.gap / 2.0))
    inside = (rows >= 0) & body[np.maximum(rows, 0)]
    usable = (usable & np.isfinite(view.offset))[inside]
    sums = np.where(usable, view.offset[inside], 0.0).sum(axis=0, dtype=np.float64)
    counts = usable.sum(axis=0, dtype=np.float64)
    sums, counts = (np.concatenate(([0.0], np.cumsum(a))) for a in (sums, counts))
    n = len(view.s)
    c = np.arange(n)

    def mean(first: NDArray[np.int64], last: NDArray[np.int64]) -> tuple[NDArray, NDArray]:
        first, last = np.clip(first, 0, n), np.clip(last, 0, n)
        number = counts[last] - counts[first]
        return (sums[last] - sums[first]) / np.maximum(number, 1.0), number

    left, number_left = mean(c - gap - strip, c - gap)
    right, number_right = mean(c + gap, c + gap + strip)
    # Full strips of a metre count wholly, smaller ones are noisier.
    full = strip / pixel
    share = np.clip(np.minimum(number_left, number_right) / full, 0.0, 1.0)
    return (left - right) / settings.step_noise * np.sqrt(share) * (share > 0.2)


@njit(cache=True)
def row_sums(
    values: NDArray[np.float32] | NDArray[np.bool_], rows: NDArray[np.int64], count: int
) -> NDArray[np.float32]:
    """Return sums (count, columns) over the rows of each piece."""
    sums = np.zeros((count, values.shape[1]), np.float32)
    for row in range(len(rows)):
        if rows[row] >= 0:
            for column in range(values.shape[1]):
                sums[rows[row], column] += np.float32(values[row, column])
    return sums


def largest_near(values: NDArray[np.float32], size: int = 9) -> NDArray[np.float32]:
    """Return the largest value (less rounding) within a window about each."""
    return cv2.dilate(values[None], np.ones((1, size), np.uint8))[0] - np.float32(1e-6)
