"""Occlusion: objects that something in front of them divides in the image."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numba import njit
from numpy.typing import NDArray


def find_occluded_pairs(
    masks: Sequence[NDArray[np.bool_]], free_depth: NDArray[np.float32], min_rows: int
) -> list[tuple[int, int]]:
    """Return the pairs of objects between which there is nothing but a nearer object.

    Parameters
    ----------
    masks
        (height, width) of each object, the nearest first.
    free_depth
        (height, width) up to where a pixel is empty, infinite where it shows the support.
    min_rows
        In which the two lie on both sides of the same nearer thing.
    """
    labels = np.full(free_depth.shape, -1, dtype=np.int32)
    for label, mask in enumerate(masks):
        labels[mask] = label
    rows = _count_rows(labels, free_depth, len(masks))
    return [(int(a), int(b)) for a, b in np.argwhere(np.triu(rows + rows.T, 1) >= min_rows)]


@njit(cache=True)
def _count_rows(
    labels: NDArray[np.int32], free_depth: NDArray[np.float32], objects: int
) -> NDArray[np.int64]:
    """Count (objects, objects) in how many rows one follows another after a nearer one."""
    rows = np.zeros((objects, objects), dtype=np.int64)
    height, width = labels.shape
    for row in range(height):
        before, last = -1, -1  # the last two objects, with no support between them
        for column in range(width):
            label = labels[row, column]
            if label < 0 and np.isinf(free_depth[row, column]):
                before, last = -1, -1
            if label < 0 or label == last:
                continue
            if before >= 0 and before != label and last < min(before, label):
                rows[before, label] += 1
            before, last = last, label
    return rows
