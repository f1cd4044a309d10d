"""Connected components by union-find, for compiled loops."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray


@njit(cache=True)
def root(parents: NDArray[np.int32], i: int) -> int:
    """Find the representative of a set, halving the path to it."""
    while parents[i] != i:
        parents[i] = parents[parents[i]]
        i = parents[i]
    return i


@njit(cache=True)
def join(parents: NDArray[np.int32], i: int, j: int) -> None:
    """Join the sets of two elements; the smallest index represents a set."""
    a, b = root(parents, i), root(parents, j)
    if a < b:
        parents[b] = a
    else:
        parents[a] = b


@njit(cache=True)
def number(parents: NDArray[np.int32], kept: NDArray[np.bool_]) -> NDArray[np.int32]:
    """Return labels 0, 1, ... of the sets of the kept elements; -1 for the others."""
    labels = np.full(len(parents), -1, dtype=np.int32)
    count = 0
    for i in range(len(parents)):
        if kept[i]:
            representative = root(parents, i)
            if representative == i:
                labels[i] = count
                count += 1
            else:
                labels[i] = labels[representative]
    return labels
