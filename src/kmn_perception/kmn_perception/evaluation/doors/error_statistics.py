"""Statistics of the errors of many doors, as written to JSON and printed."""

from __future__ import annotations

from collections.abc import Sequence
from statistics import NormalDist
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kmn_perception.command_line.columns import NONE, text
from kmn_perception.evaluation.doors.errors import UNITS, DoorErrors
from kmn_perception.evaluation.quantile import quantile

# Keys of the results, and the quantities whose errors they hold.
ERRORS = {
    "edge_mm": ("left", "right"), "width_mm": ("width",), "top_mm": ("top",),
    "yaw_deg": ("yaw",), "handle_up_mm": ("handle_up",), "handle_along_mm": ("handle_along",),
    "opening_deg": ("opening",),
}  # fmt: skip
HEADS = {key: key.rpartition("_")[0].replace("handle_", "") for key in ERRORS}
DIGITS = {"mm": 1, "deg": 2}


def error_sizes(off: Sequence[DoorErrors], key: str) -> dict[str, float | None]:
    """Return median and 95th percentile of the sizes of errors that a key stands for."""
    rows = [list(UNITS).index(name) for name in ERRORS[key]]
    sizes: NDArray[np.float64] = np.abs([e.values[rows] for e in off]).ravel()
    known = sizes[np.isfinite(sizes)].tolist()
    return {"median": quantile(known, 50), "p95": quantile(known, 95)}


def coverage(off: Sequence[DoorErrors], confidence: float) -> float | None:
    """Return the share of stated quantities whose errors are as their deviations say."""
    limit = NormalDist().inv_cdf(0.5 + 0.5 * confidence)
    ratios = np.concatenate([e.ratios[e.stated > 0.0] for e in off]) if off else np.empty(0)
    known = ratios[np.isfinite(ratios)]
    return round(float((known < limit).mean()), 4) if known.size else None


def times(seconds: Sequence[float]) -> dict[str, float | None]:
    """Return median and 95th percentile in milliseconds."""
    milliseconds = [1e3 * value for value in seconds]
    return {"median": quantile(milliseconds, 50), "p95": quantile(milliseconds, 95)}


def error_cells(statistics: dict[str, Any]) -> list[str]:
    """Return median and 95th percentile by each key of ``ERRORS``, as they are printed."""
    return [pair(statistics.get(key), DIGITS[key.rpartition("_")[2]]) for key in ERRORS]


def pair(value: dict[str, Any] | None, digits: int) -> str:
    """Return median and 95th percentile as they are printed."""
    if value is None or value["median"] is None:
        return NONE
    return " / ".join(text(value[key], 1.0, digits) for key in ("median", "p95"))
