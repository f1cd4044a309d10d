"""Whether the truth lies within the ellipsoid that a covariance stands for."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
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
    """Return the quantile of the chi-square distribution, by bisection."""
    low, high = 0.0, 1.0
    while _chi2_probability(high, degrees) < probability:
        high *= 2.0
    while low < (middle := (low + high) / 2.0) < high:
        if _chi2_probability(middle, degrees) < probability:
            low = middle
        else:
            high = middle
    return high


def _chi2_probability(value: float, degrees: int) -> float:
    """Return P(degrees / 2, value / 2), the regularised lower incomplete gamma function.

    P(1/2, x) = erf(sqrt(x)), P(1, x) = 1 - exp(-x), and P(a + 1, x) = P(a, x) - x^a exp(-x) /
    Gamma(a + 1) (DLMF 7.11.1, 8.4.5, 8.8.5).
    """
    x, odd = value / 2.0, degrees % 2 == 1
    a, probability = (0.5, math.erf(math.sqrt(x))) if odd else (1.0, -math.expm1(-x))
    while a < degrees / 2.0:
        probability -= math.exp(a * math.log(x) - x - math.lgamma(a + 1.0))
        a += 1.0
    return probability
