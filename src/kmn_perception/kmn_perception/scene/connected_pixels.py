"""Connected pixels of an organised cloud, with holes in which nothing was measured."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from kmn_perception.scene.union_find import join, number


@njit(cache=True)
def label_image(
    points: NDArray[np.float32], kept: NDArray[np.bool_], step: float, max_gap: int
) -> NDArray[np.int32]:
    """Label the connected components of an organised cloud's kept points (height * width,).

    Pixels beside each other, or with nothing measured between them, are connected if their points
    are no further apart than ``step``: objects that touch are still told apart where the camera
    sees a step between them.
    """
    height, width, _ = points.shape
    flat = points.reshape(-1, 3)
    parents = np.arange(height * width, dtype=np.int32)
    above = np.full(width, -1, dtype=np.int32)  # last measured pixel of each column
    for row in range(height):
        before = -1
        for column in range(width):
            i = row * width + column
            if kept[i]:
                for k in range(2):
                    j = before if k == 0 else above[column]
                    reach = (max_gap + 1) * (1 if k == 0 else width)
                    if j >= 0 and i - j <= reach and kept[j] and _near(flat, i, j, step):
                        join(parents, i, j)
            if np.isfinite(flat[i, 2]):
                before = above[column] = i
    return number(parents, kept)


@njit(cache=True)
def grow(
    points: NDArray[np.float32],
    labels: NDArray[np.int32],
    kept: NDArray[np.bool_],
    step: float,
    min_points: int,
    max_gap: int,
) -> NDArray[np.int32]:
    """Give kept pixels that belong to no large part to the part from which fewest steps lead.

    A step may lead over a gap without a measurement.
    """
    width, flat = points.shape[1], points.reshape(-1, 3)
    counts = np.zeros(labels.max() + 2, dtype=np.int64)
    for label in labels:
        counts[label] += 1
    grown = np.full_like(labels, -1)
    queue = np.empty(len(labels), dtype=np.int32)
    last = 0
    for i in range(len(labels)):
        if labels[i] >= 0 and counts[labels[i]] >= min_points:
            grown[i], queue[last] = labels[i], i
            last += 1
    first = 0
    while first < last:
        i = queue[first]
        first += 1
        row, column = i // width, i % width
        for k in range(4):
            stride = (1, -1, width, -width)[k]
            inside = (width - 1 - column, column, len(labels) // width - 1 - row, row)[k]
            j = i
            for _ in range(min(inside, max_gap + 1)):
                j += stride
                if np.isfinite(flat[j, 2]):
                    break
            if j != i and kept[j] and grown[j] < 0 and _near(flat, i, j, step):
                grown[j], queue[last] = grown[i], j
                last += 1
    return grown


@njit(cache=True)
def _near(points: NDArray[np.float32], i: int, j: int, step: float) -> bool:
    """Tell whether two points are no further apart than ``step``."""
    x = points[i, 0] - points[j, 0]
    y = points[i, 1] - points[j, 1]
    z = points[i, 2] - points[j, 2]
    return x * x + y * y + z * z <= step * step


@njit(cache=True)
def share_of_holes(
    points: NDArray[np.float32], labels: NDArray[np.int32], objects: int, max_gap: int
) -> NDArray[np.float64]:
    """Return the share (objects,) of unmeasured pixels, in short gaps between those of an object.

    It is the larger one of the shares along rows and along columns.

    Parameters
    ----------
    points, labels
        (height, width, 3) metres, NaN for none, and (height, width) the object of each pixel,
        negative for none.
    """
    height, width = labels.shape
    shares = np.zeros((2, objects))
    for along in range(2):
        holes, shown = np.zeros(objects), np.zeros(objects)
        for k in range(height if along == 0 else width):
            last, last_label = -1, -1
            for m in range(width if along == 0 else height):
                row, column = (k, m) if along == 0 else (m, k)
                if not np.isfinite(points[row, column, 2]):
                    continue
                label = labels[row, column]
                if label >= 0:
                    shown[label] += 1
                    if label == last_label and m - last - 1 <= max_gap:
                        holes[label] += m - last - 1
                last, last_label = m, label
        shares[along] = holes / np.maximum(holes + shown, 1)
    return np.maximum(shares[0], shares[1])
