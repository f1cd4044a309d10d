"""Percentiles as they are written to JSON."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np


def quantile(values: Sequence[float], percent: float) -> float | None:
    """Return a percentile, rounded; None of no values."""
    return round(float(np.percentile(values, percent)), 5) if values else None
