"""The tables that the evaluation prints."""

from __future__ import annotations

from typing import Any

from kmn_perception.command_line.columns import NONE, columns
from kmn_perception.evaluation.settings import PaperErrors

FEW_DIGITS = 1e-4  # smaller errors are written with an exponent

PAPER_METHOD = {
    "baseline": "baseline",
    "kmn_paper": "kmn",
    "kmn": "kmn",
    "kmn_refined": "kmn",
    "icp": "icp",
    "icp_identity": "icp",
}
"""With which of the paper's methods a method is compared."""

Rows = list[list[str]]


def report(result: dict[str, Any], paper: PaperErrors) -> str:
    """Return the tables of an evaluation, beside the errors that the paper reports.

    Parameters
    ----------
    result
        As written to JSON.
    """
    title = (
        f"{result['model']}: {result['samples']} samples, seed {result['seed']}, "
        f"noise {result['noise']}"
    )
    return "\n\n".join(
        [
            title,
            "Sum over the parameters of absolute errors\n" + columns(summary(result, paper)),
            "Mean of it after each step\n" + columns(_by_step(result)),
            "Mean of it by visible fraction\n" + columns(by_visible_fraction(result)),
            "Mean absolute error of each parameter\n" + columns(by_parameter(result, paper)),
            "Median absolute error of each parameter\n" + columns(_medians(result)),
        ]
    )


def summary(result: dict[str, Any], paper: PaperErrors) -> Rows:
    """Return the statistics of all methods beside the errors that the paper reports."""
    rows = [["method", "mean", "median", "p95", "paper", "of paper", "in 95 %", "ms", "samples"]]
    for name, method in result["methods"].items():
        reported = paper.get(PAPER_METHOD.get(name, ""), {}).get("mean")
        rows.append(
            [
                name,
                *[error(method[key]) for key in ("mean", "median", "p95")],
                error(reported),
                _ratio(method["mean"], reported),
                f"{100 * method['coverage95']:.1f} %" if "coverage95" in method else NONE,
                f"{method['milliseconds']:.1f}",
                str(method["samples"]),
            ]
        )
    return rows


def by_visible_fraction(result: dict[str, Any]) -> Rows:
    """Return the mean errors of all methods by the visible fraction of the object."""
    methods = result["methods"]
    bins = next(iter(methods.values()))["by_visible_fraction"]
    rows = [["visible", *[f"{part['low']:g} to {part['high']:g}" for part in bins]]]
    for name, method in methods.items():
        rows.append([name, *[error(part["mean"]) for part in method["by_visible_fraction"]]])
    largest = max(methods.values(), key=lambda method: int(method["samples"]))
    rows.append(["samples", *[str(part["samples"]) for part in largest["by_visible_fraction"]]])
    return rows


def by_parameter(result: dict[str, Any], paper: PaperErrors) -> Rows:
    """Return the mean errors of each parameter, beside the paper's."""
    methods = result["methods"]
    names = list(next(iter(methods.values()))["per_parameter"])
    rows = [["method", *names]]
    for name, method in methods.items():
        rows.append([name, *[error(method["per_parameter"][parameter]) for parameter in names]])
    for name, errors in paper.items():
        rows.append([f"paper {name}", *[error(errors.get(parameter)) for parameter in names]])
    return rows


def _medians(result: dict[str, Any]) -> Rows:
    medians = {name: m["per_parameter_median"] for name, m in result["methods"].items()}
    names = list(next(iter(medians.values())))
    rows = [[name, *[error(of[parameter]) for parameter in names]] for name, of in medians.items()]
    return [["method", *names], *rows]


def error(value: float | None) -> str:
    """Return an error in digits, or the sign for none."""
    if value is None:
        return NONE
    return f"{value:.1e}" if 0.0 < value < FEW_DIGITS else f"{value:.5f}"


def _by_step(result: dict[str, Any]) -> Rows:
    steps = max(len(method["by_step"]) for method in result["methods"].values())
    rows = [["step", *map(str, range(steps))]]
    for name, method in result["methods"].items():
        errors = [error(value) for value in method["by_step"]]
        rows.append([name, *errors, *[NONE] * (steps - len(errors))])
    return rows


def _ratio(value: float, reported: float | None) -> str:
    if reported is None:
        return NONE
    ratio = value / reported
    return f"{ratio:.2f}" if ratio >= 0.1 else f"{ratio:.2g}"
