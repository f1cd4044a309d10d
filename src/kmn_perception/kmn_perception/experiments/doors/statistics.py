"""The statistics of the experiment on doors, as written to JSON."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from kmn_perception.evaluation.doors.error_statistics import ERRORS, coverage, error_sizes, times
from kmn_perception.evaluation.doors.errors import UNITS, DoorErrors
from kmn_perception.experiments.doors.experiment import (
    MODES,
    WITH_COLOUR,
    DoorResult,
    Outcome,
)
from kmn_perception.experiments.settings import ExperimentSettings
from kmn_perception.experiments.statistics import Statistics

BASELINE_ERRORS = ("edge_mm", "width_mm", "yaw_deg")


def statistics(results: Sequence[DoorResult], settings: ExperimentSettings) -> Statistics:
    """Return the statistics with colour, below ``depth_alone`` those without, and each frame.

    Errors are sizes of errors of the doors that are found. Opening angles count where estimate or
    label are open.
    """
    by_mode = {mode: _of_mode(results, mode, settings) for mode in MODES}
    return {
        **by_mode[WITH_COLOUR],
        "baselines": {
            name: _of_baseline(results, [result.baselines[name] for result in results])
            for name in (results[0].baselines if results else ())
        },
        **{mode: by_mode[mode] for mode in MODES if mode != WITH_COLOUR},
        "per_frame": {result.name: _of_frame(result) for result in results},
    }


def _of_mode(results: Sequence[DoorResult], mode: str, settings: ExperimentSettings) -> Statistics:
    outcomes = [result.outcomes[mode] for result in results]
    off = [outcome.errors for outcome in outcomes if outcome.errors]
    return {
        **_counts(results, outcomes),
        **{key: error_sizes(off, key) for key in ERRORS},
        "coverage95": coverage(off, settings.confidence),
        "milliseconds": times([result.seconds[mode] for result in results]),
    }


def _of_baseline(results: Sequence[DoorResult], outcomes: Sequence[Outcome]) -> Statistics:
    off = [outcome.errors for outcome in outcomes if outcome.errors]
    return {**_counts(results, outcomes), **{key: error_sizes(off, key) for key in BASELINE_ERRORS}}


def _counts(results: Sequence[DoorResult], outcomes: Sequence[Outcome]) -> Statistics:
    """Return how many frames there are, and of which a door is found, rightly or not."""
    is_there = [result.label is not None for result in results]
    found = [outcome.found for outcome in outcomes]
    return {
        "frames": len(results),
        "found": sum(f and there for f, there in zip(found, is_there, strict=True)),
        "ok_and_wrong": sum(outcome.wrong for outcome in outcomes),
        "negatives": is_there.count(False),
        "negatives_ok": sum(f and not there for f, there in zip(found, is_there, strict=True)),
    }


def _of_frame(result: DoorResult) -> dict[str, Any]:
    label = result.label
    truth: dict[str, Any] = {"door": label is not None}
    if label is not None:
        truth |= {
            "edges_in_view": label.edges_in_view,
            "distance_m": round(float(np.linalg.norm(label.centre)), 3),
        }
    modes = {mode: _of_estimate(result, mode) for mode in MODES}
    baselines = {
        name: {"found": outcome.found, "ok_and_wrong": outcome.wrong, **_errors(outcome.errors)}
        for name, outcome in result.baselines.items()
    }
    return {**truth, **modes, "baselines": baselines}


def _of_estimate(result: DoorResult, mode: str) -> dict[str, Any]:
    estimate, outcome = result.estimates[mode], result.outcomes[mode]
    return {
        "status": estimate.status.name,
        "reason": estimate.reason,
        "ok_and_wrong": outcome.wrong,
        "handle_side": estimate.handle_side,
        "handle_kind": estimate.handle_kind,
        **_errors(outcome.errors),
        "milliseconds": round(1e3 * result.seconds[mode], 2),
    }


def _errors(off: DoorErrors | None) -> dict[str, Any]:
    """Return errors with their stated and combined deviations, as far as they are known."""
    if off is None:
        return {}
    rows = zip(UNITS.items(), *off, strict=True)
    return {
        "errors": {
            f"{name}_{unit}": {
                "error": round(float(error), 3),
                "stated": None if np.isnan(stated) else round(float(stated), 3),
                "combined": None if np.isnan(combined) else round(float(combined), 3),
            }
            for (name, unit), error, stated, combined in rows
            if np.isfinite(error)
        }
    }
