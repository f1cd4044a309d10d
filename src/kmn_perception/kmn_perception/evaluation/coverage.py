"""Whether the truth lies within the ellipsoid that a covariance stands for."""

from __future__ import annotations

from functools import cache

import numpy as np
import torch
from numpy.typing import NDArray

from kmn_perception.model.kinematic_model import KinematicModel

MIN_DEVIATION = 1e-9  # of half a parameter's range; what is known better counts as known so well


def is_covered(
    model: KinematicModel,
    values: NDArray[np.float64],
    covariance: NDArray[np.float64],
    truth: NDArray[np.float64],
    confidence: float,
) -> bool:
    """Tell whether the truth lies within the confidence ellipsoid around an estimate.

    Parameters
    ----------
    values, truth
        (n + m,) estimated and true morphing parameters.
    covariance
        (n + m, n + m) of the estimate; one that is not finite covers nothing.
    confidence
        Probability that the ellipsoid stands for, e.g. 0.95.
    """
    half_width = np.ptp(model.limits, axis=1) / 2.0
    off = (model.nearest_equivalent(truth, values) - values) / half_width
    scaled = covariance / np.outer(half_width, half_width)
    if not (np.isfinite(off).all() and np.isfinite(scaled).all()):
        return False
    variances, axes = np.linalg.eigh(scaled)
    distance = ((axes.T @ off) ** 2 / np.maximum(variances, MIN_DEVIATION**2)).sum()
    return bool(distance <= chi2_quantile(confidence, len(off)))


@cache
def chi2_quantile(probability: float, degrees: int) -> float:
    """Return the quantile of the chi-square distribution, by bisection of the incomplete gamma."""
    shape = torch.tensor(degrees / 2.0, dtype=torch.float64)
    low, high = 0.0, 1.0
    while _chi2_probability(shape, high) < probability:
        high *= 2.0
    while low < (middle := (low + high) / 2.0) < high:
        if _chi2_probability(shape, middle) < probability:
            low = middle
        else:
            high = middle
    return high


def _chi2_probability(shape: torch.Tensor, value: float) -> float:
    half = torch.tensor(value / 2.0, dtype=torch.float64)
    return float(torch.special.gammainc(shape, half))
