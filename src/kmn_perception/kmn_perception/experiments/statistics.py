"""The statistics of the experiment, as written to JSON and printed."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from kmn_perception.command_line.columns import NONE, columns, text
from kmn_perception.evaluation.quantile import quantile
from kmn_perception.experiments.experiment import FrameResult
from kmn_perception.experiments.scores import Score
from kmn_perception.experiments.settings import ExperimentSettings

Statistics = dict[str, Any]


def statistics(results: Sequence[FrameResult], settings: ExperimentSettings) -> Statistics:
    """Return all statistics; only objects that are visible enough count.

    Sizes are of sides in view. Centre and overlap are of objects with all sides in view; of the
    others the reference does not know them.
    """
    scores = [s for result in results for s in result.scores]
    seconds = [result.seconds for result in results]
    hidden = [s for s in scores if not _counts(s, settings)]
    return {
        "frames": len(results),
        **_of_method(scores, sum(_false(results, "")), settings),
        "milliseconds": {
            "median": _round(1e3 * float(np.median(seconds)), 2),
            "max": _round(1e3 * max(seconds), 2),
        },
        "baselines": {
            name: _of_method(
                [s for result in results for s in result.baselines[name]],
                sum(_false(results, name)),
                settings,
            )
            for name in results[0].baselines
        },
        "size_error_by_side_m": _by_side(scores, settings),
        "gross": sum(s.gross for s in scores),
        "less_visible": {
            "objects": len(hidden),
            "found": sum(s.detection is not None for s in hidden),
        },
        "unmeasured": sum(len(r.frame.objects) - len(r.references.boxes) for r in results),
        "predictions": {
            "real": _mean([n for result in results for n in result.predictions]),
            "simulated": _mean([n for result in results for n in result.simulated_predictions]),
        },
        "reference_deviation": _reference_deviation(scores, settings),
    }


def _false(results: Sequence[FrameResult], method: str) -> list[int]:
    return [result.false_found[method] for result in results]


def _counts(score: Score, settings: ExperimentSettings) -> bool:
    return score.reference.visible >= settings.visible


def _of_method(
    scores: Sequence[Score], false_found: int, settings: ExperimentSettings
) -> Statistics:
    """Return the statistics of one method over all objects that count."""
    counted = [s for s in scores if _counts(s, settings)]
    found = [s for s in counted if s.detection is not None]
    whole = [s for s in found if s.reference.in_view.all()]
    yaw = [float(np.degrees(s.errors.yaw)) for s in found]
    sizes = [e for s in found for e in s.errors.size[s.reference.sizes_in_view].tolist()]
    result = {
        "objects": len(counted),
        "found": len(found),
        "false_found": false_found,
        "yaw_error_deg": {"median": quantile(yaw, 50), "p95": quantile(yaw, 95)},
        "size_error_m": {"median": quantile(sizes, 50), "p95": quantile(sizes, 95)},
        "centre_error_m": {"median": quantile([s.errors.centre for s in whole], 50)},
        "iou": {"median": quantile([s.overlap for s in whole], 50)},
        "whole": len(whole),
    }
    stated = [s.covered for s in found if s.covered is not None]
    if stated:
        result["coverage95"] = _round(float(np.mean(stated)), 4)
    return result


def _by_side(scores: Sequence[Score], settings: ExperimentSettings) -> Statistics:
    """Return the median size errors of the longer and the shorter level side, and of the height."""
    errors: dict[str, list[float]] = {"long": [], "short": [], "height": []}
    for s in scores:
        if s.detection is not None and _counts(s, settings):
            size, seen = s.reference.box.size, s.reference.sizes_in_view
            long = int(size[1] > size[0])
            for name, axis in zip(errors, (long, 1 - long, 2), strict=True):
                errors[name] += [float(s.errors.size[axis])] if seen[axis] else []
    return {name: {"median": quantile(values, 50)} for name, values in errors.items()}


def _reference_deviation(scores: Sequence[Score], settings: ExperimentSettings) -> Statistics:
    """Return how well the references themselves are known."""
    references = [s.reference for s in scores if _counts(s, settings)]
    yaw = [float(np.degrees(r.yaw_deviation)) for r in references]
    sides = [d for r in references for d in r.side_deviations[r.in_view].tolist()]
    return {"yaw_deg": {"median": quantile(yaw, 50)}, "side_m": {"median": quantile(sides, 50)}}


def _mean(values: Sequence[int]) -> float | None:
    return _round(float(np.mean(values)), 3) if values else None


def _round(value: float, digits: int) -> float:
    return round(value, digits)


def object_table(results: Sequence[FrameResult]) -> str:
    """Return a line for each labelled object."""
    rows = [["object", "visible", "yaw [deg]", "size [mm]", "centre [mm]", "IoU", "in 95 %", ""]]
    for result in results:
        rows += [_row(s) for s in result.scores]
    return columns(rows)


def _row(score: Score) -> list[str]:
    reference, off = score.reference, score.errors
    name = [f"{score.frame} {reference.label}", f"{100 * reference.visible:.0f} %"]
    if score.detection is None:
        return [*name, *[NONE] * 5, "not found"]
    sizes = [
        f"{1e3 * error:.1f}" if seen else f"({1e3 * error:.1f})"
        for error, seen in zip(off.size, reference.sizes_in_view, strict=True)
    ]
    whole = bool(reference.in_view.all())
    return [
        *name,
        f"{np.degrees(off.yaw):.2f}",
        " ".join(sizes),
        f"{1e3 * off.centre:.1f}" if whole else NONE,
        f"{score.overlap:.3f}" if whole else NONE,
        {None: NONE, True: "yes", False: "no"}[score.covered],
        "gross" if score.gross else "",
    ]


def method_table(result: Statistics) -> str:
    """Return a line for the estimates, and one for each baseline."""
    parts: list[tuple[str, Callable[[Statistics], str]]] = [
        ("found", lambda m: f"{m['found']} of {m['objects']}"),
        ("false", lambda m: str(m["false_found"])),
        ("yaw [deg]", lambda m: text(m["yaw_error_deg"]["median"], 1.0, 2)),
        ("p95", lambda m: text(m["yaw_error_deg"]["p95"], 1.0, 2)),
        ("size [mm]", lambda m: text(m["size_error_m"]["median"], 1e3, 1)),
        ("p95", lambda m: text(m["size_error_m"]["p95"], 1e3, 1)),
        ("centre [mm]", lambda m: text(m["centre_error_m"]["median"], 1e3, 1)),
        ("IoU", lambda m: text(m["iou"]["median"], 1.0, 3)),
        ("in 95 %", lambda m: text(m.get("coverage95"), 100.0, 0)),
    ]
    rows = [["method", *[name for name, _ in parts]]]
    for name, method in {"this package": result, **result["baselines"]}.items():
        rows.append([name, *[cell(method) for _, cell in parts]])
    return columns(rows)


def details(result: Statistics) -> str:
    """Return in words what the table does not hold."""
    by_side, steps = result["size_error_by_side_m"], result["predictions"]
    sides = ", ".join(f"{name} {text(e['median'], 1e3, 1)}" for name, e in by_side.items())
    own, hidden = result["reference_deviation"], result["less_visible"]
    times = result["milliseconds"]
    return "\n".join(
        [
            f"Size errors by side [mm]: {sides}",
            f"Less visible objects: {hidden['found']} of {hidden['objects']} found",
            f"Sides stated as well known and wrong by far: {result['gross']}",
            f"Milliseconds of one core a frame: {times['median']:.0f} median, "
            f"{times['max']:.0f} maximum",
            "Predictions of the paper's network until one changes little: "
            f"{text(steps['real'], 1.0, 1)}, in simulation {text(steps['simulated'], 1.0, 1)}",
            f"Standard deviations of the references: yaw {text(own['yaw_deg']['median'], 1.0, 2)} "
            f"deg, a side {text(own['side_m']['median'], 1e3, 1)} mm",
        ]
    )
