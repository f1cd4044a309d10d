"""How often residuals count that are not independent of each other."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray


@njit(cache=True, error_model="numpy")
def alike(sums: NDArray[np.float64], lags: int) -> float:
    """Return the variance of the sum of the residuals of all rows, as those of each row show it.

    Parameters
    ----------
    sums
        (K,) sum of the residuals of each row.
    lags
        So many neighbouring rows may be shifted alike, too (Newey and West).
    """
    variance = alone = (sums**2).sum()
    for lag in range(1, lags):
        variance += 2.0 * (1.0 - lag / lags) * (sums[lag:] * sums[:-lag]).sum()
    return float(max(alone, variance))
