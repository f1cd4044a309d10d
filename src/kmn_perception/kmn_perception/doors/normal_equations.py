"""The normal equations of a fit to blocks of inverse depths, in a compiled loop."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray


@njit(cache=True)
def add_blocks(
    information: NDArray[np.float64],
    right_side: NDArray[np.float64],
    rows: NDArray[np.float64],
    inverse: NDArray[np.float64],
    values: NDArray[np.float64],
    reach: float,
    noise: float,
) -> int:
    """Add the blocks that values explain within reach; return how many.

    Parameters
    ----------
    information, right_side
        (P, P) and (P,), to which they are added.
    rows, inverse
        (N, P) derivatives of the inverse depths, and (N,) these, 1/m.
    values
        (P,) present values.
    reach, noise
        Largest difference, and standard deviation of an inverse depth, 1/m.
    """
    count, size = 0, len(values)
    matrix, vector = np.zeros((size, size)), np.zeros(size)
    for i in range(len(inverse)):
        row, off = rows[i], -inverse[i]
        for a in range(size):
            off += row[a] * values[a]
        if abs(off) < reach:
            count += 1
            for a in range(size):
                if row[a] != 0.0:
                    vector[a] += row[a] * inverse[i]
                    for b in range(a + 1):
                        matrix[a, b] += row[a] * row[b]
    for a in range(size):
        right_side[a] += vector[a] / noise**2
        for b in range(a):
            information[b, a] += matrix[a, b] / noise**2
        for b in range(a + 1):
            information[a, b] += matrix[a, b] / noise**2
    return count
