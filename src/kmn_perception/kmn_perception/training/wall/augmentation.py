"""Windows of views, changed at random as walls, light and sensors may change them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from kmn_perception.training.wall.samples import SCALE, Sample
from kmn_perception.training.wall.settings import AugmentationSettings
from kmn_perception.training.wall.targets import Target

_STEPS = slice(0, 2)  # channels of the cells, see `cells_of`: steps of grey to the right and down,
_RIGHT, _OFFSET = 0, 2  # the first of them, offsets of the inverse depth,
_SHARES = slice(3, 6)  # shares of a cell, which are -1 where there is nothing,
_ASIDE = 6  # and how far the camera looks aside


def window(
    sample: Sample, settings: AugmentationSettings, generator: np.random.Generator
) -> tuple[NDArray[np.float32], Target]:
    """Return cells (CHANNELS, ROWS, columns) of a changed part of a view, and what they show."""
    stretch = np.exp(generator.uniform(-1.0, 1.0) * np.log(settings.stretch))
    width = round(settings.columns * stretch)
    first = _first_column(sample, width, settings, generator)
    cells, target = _cut(sample, first, width), sample.target.shifted(first)
    cells = _resized(cells, settings.columns)
    target = target.stretched(settings.columns / width)
    lift = int(generator.integers(-settings.lift, settings.lift, endpoint=True))
    rows = np.clip(np.arange(cells.shape[1]) + lift, 0, cells.shape[1] - 1)
    cells, target = cells[:, rows], target.lifted(lift)
    if generator.random() < settings.mirror:
        cells, target = cells[:, :, ::-1].copy(), target.mirrored(settings.columns)
        cells[[_RIGHT, _ASIDE]] *= -1.0
    if generator.random() < settings.invert:
        cells[_STEPS] *= -1.0
    if generator.random() < settings.weaken.share:
        cells[_STEPS] *= generator.uniform(*settings.weaken.factor)
    if generator.random() < settings.depth_alone:
        cells[_STEPS] = 0.0
    if generator.random() < settings.flush:
        cells[_OFFSET] = 0.0
    deviation = settings.noise * generator.random()
    cells[_STEPS] += deviation * generator.standard_normal(cells[_STEPS].shape, np.float32)
    return cells, target


def whole(sample: Sample) -> NDArray[np.float32]:
    """Return the cells (CHANNELS, ROWS, N) of a view as they are."""
    return sample.cells.astype(np.float32) / np.float32(SCALE)


def _first_column(
    sample: Sample, width: int, settings: AugmentationSettings, generator: np.random.Generator
) -> int:
    """Draw where a window begins: near a door, or anywhere with half of it in the view at least."""
    available = sample.cells.shape[2]
    edges = np.array([sample.target.left, sample.target.right])
    known = np.isfinite(edges)
    if sample.target.door and generator.random() < settings.near_door:
        middle = edges[known].mean() if known.any() else available / 2.0
        beside = generator.uniform(-settings.beside, settings.beside)
        return round(middle + (beside - 0.5) * width)
    half = min(width, available) // 2
    return int(generator.integers(half - width, available - half, endpoint=True))


def _resized(cells: NDArray[np.float32], columns: int) -> NDArray[np.float32]:
    """Return cells of so many columns, between which are means."""
    width = cells.shape[2]
    at = np.clip((np.arange(columns) + 0.5) * width / columns - 0.5, 0.0, width - 1.0)
    first = np.minimum(at.astype(np.int64), width - 2)
    share = (at - first).astype(np.float32)
    return (1.0 - share) * cells[:, :, first] + share * cells[:, :, first + 1]


def _cut(sample: Sample, first: int, width: int) -> NDArray[np.float32]:
    available = sample.cells.shape[2]
    cells = np.zeros((*sample.cells.shape[:2], width), np.float32)
    cells[_SHARES] = -1.0
    start, end = max(first, 0), min(first + width, available)
    if end > start:
        cells[:, :, start - first : end - first] = whole(sample)[:, :, start:end]
    return cells
