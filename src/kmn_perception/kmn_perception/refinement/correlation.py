"""The variance of a sum of residuals that are not independent of each other."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray


@njit(cache=True, error_model="numpy")
def newey_west_variance(sums: NDArray[np.float64], lags: int) -> float:
    """Return the variance of the total of a sequence, estimated from the sequence itself.

    The covariances of neighbours are weighted as by Newey and West (1987); this equals the mean
    square of the sums of all runs of ``lags`` elements. It is at least the variance of independent
    elements.

    Parameters
    ----------
    sums
        (K,) sums of the residuals of consecutive rows, of mean 0.
    lags
        Number of neighbouring rows whose residuals may be correlated.
    """
    independent, variance, window = 0.0, 0.0, 0.0
    for i in range(sums.shape[0] + lags - 1):
        if i < sums.shape[0]:
            independent += sums[i] ** 2
            window += sums[i]
        if i >= lags:
            window -= sums[i - lags]
        variance += window**2
    return float(max(independent, variance / lags))
