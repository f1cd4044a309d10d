"""The statistics of the experiment on doors, as they are printed."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from kmn_perception.command_line.columns import NONE, columns, text
from kmn_perception.evaluation.doors.error_statistics import DIGITS, HEADS, error_cells, pair
from kmn_perception.evaluation.doors.errors import UNITS
from kmn_perception.experiments.doors.experiment import (
    DEPTH_ALONE,
    WITH_COLOUR,
    WITHOUT_NETWORK,
    DoorResult,
)
from kmn_perception.experiments.statistics import Statistics

SHOWN = ("left", "right", "width", "top", "yaw", "handle_up", "handle_along", "opening")
NAMES = {
    WITH_COLOUR: "depth and colour",
    WITHOUT_NETWORK: "the same without network",
    DEPTH_ALONE: "depth alone",
}


def frame_table(results: Sequence[DoorResult], mode: str) -> str:
    """Return a line for each frame: errors in mm and degrees, the largest one in deviations."""
    heads = [name.replace("handle_", "") for name in SHOWN]
    rows = [[NAMES[mode], "status", *heads, "worst", "", "ms"]]
    rows += [_row(result, mode) for result in results]
    reasons = ["", *(result.estimates[mode].reason for result in results)]
    lines = zip(columns(rows).splitlines(), reasons, strict=True)
    return "\n".join(f"{line}  {reason}".rstrip() for line, reason in lines)


def _row(result: DoorResult, mode: str) -> list[str]:
    outcome, estimate = result.outcomes[mode], result.estimates[mode]
    cells, worst = [NONE] * len(SHOWN), NONE
    if outcome.errors is not None:
        order = list(UNITS)
        cells = [
            f"{value:+.{DIGITS[UNITS[name]]}f}" if np.isfinite(value) else NONE
            for name in SHOWN
            for value in [outcome.errors.values[order.index(name)]]
        ]
        ratios = np.nan_to_num(outcome.errors.ratios)
        worst = f"{ratios.max():.1f} {order[int(ratios.argmax())]}"
    status = estimate.status.value + (" AND WRONG" if outcome.wrong else "")
    what = "" if result.label is not None else "no door there"
    return [
        result.name, status, *cells, worst, what, f"{1e3 * result.seconds[mode]:.0f}",
    ]  # fmt: skip


def method_table(summary: Statistics) -> str:
    """Return a line for each mode and baseline: medians and 95th percentiles."""
    rows = [["median / 95 %", "found", "wrong", "not there", *HEADS.values(), "in 95 %", "ms"]]
    methods = {
        name: summary if mode == WITH_COLOUR else summary[mode] for mode, name in NAMES.items()
    }
    for name, method in {**methods, **summary["baselines"]}.items():
        doors = method["frames"] - method["negatives"]
        rows.append(
            [
                name.replace("_", " "),
                f"{method['found']} of {doors}",
                str(method["ok_and_wrong"]),
                f"{method['negatives_ok']} of {method['negatives']}",
                *error_cells(method),
                text(method.get("coverage95"), 100.0, 0),
                pair(method.get("milliseconds"), 0),
            ]
        )
    return columns(rows)


def in_view(results: Sequence[DoorResult]) -> str:
    """Return in words how many of the doors are found that have both edges in view."""
    seen = [r for r in results if r.label is not None and r.label.edges_in_view]
    found = {mode: sum(r.outcomes[mode].found for r in seen) for mode in NAMES}
    counts = ", ".join(f"{n} with {NAMES[mode]}" for mode, n in found.items())
    return f"Of {len(seen)} doors with both edges in view there are found: {counts}"
