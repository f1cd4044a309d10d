"""How often residuals count that are not independent of each other."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray


@njit(cache=True, error_model="numpy")
def correlated_count(sums: NDArray[np.float64], lags: int) -> float:
    """Return the variance of the sum of the residuals of all rows, as those of each row show it.

    Parameters
    ----------
    sums
        (K,) sum of the residuals of each row.
    lags
        So many neighbouring rows may be shifted alike, too. Their covariances are weighted as by
        Newey and West, which the mean square of the sums of all runs of ``lags`` rows amounts to.
    """
    alone, variance, window = 0.0, 0.0, 0.0
    for i in range(sums.shape[0] + lags - 1):
        if i < sums.shape[0]:
            alone += sums[i] ** 2
            window += sums[i]
        if i >= lags:
            window -= sums[i - lags]
        variance += window**2
    return float(max(alone, variance / lags))
