"""The tables that the evaluation prints."""

from __future__ import annotations

from typing import Any

from kmn_perception.columns import columns
from kmn_perception.evaluation.settings import PaperFigures
from kmn_perception.kinematic_model import KinematicModel

NONE = "-"


def report(model: KinematicModel, result: dict[str, Any], paper: PaperFigures) -> str:
    """Return the tables of an evaluation, beside the paper's figures.

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
            "Sum over the parameters of absolute errors\n" + _summary(result, paper),
            "Mean of it after each step\n" + _by_step(result),
            "Mean absolute error of each parameter\n" + _by_parameter(model, result, paper),
        ]
    )


def _summary(result: dict[str, Any], paper: PaperFigures) -> str:
    rows = [["method", "mean", "median", "p95", "paper", "of paper", "ms"]]
    for name, method in result["methods"].items():
        figure = paper.get(name, {}).get("mean")
        rows.append(
            [
                name,
                *[_error(method[key]) for key in ("mean", "median", "p95")],
                _error(figure),
                f"{method['mean'] / figure:.2f}" if figure else NONE,
                f"{method['milliseconds']:.1f}",
            ]
        )
    return columns(rows)


def _by_step(result: dict[str, Any]) -> str:
    most = max(len(method["by_step"]) for method in result["methods"].values())
    rows = [["step", *map(str, range(most))]]
    for name, method in result["methods"].items():
        errors = [_error(error) for error in method["by_step"]]
        rows.append([name, *errors, *[NONE] * (most - len(errors))])
    return columns(rows)


def _by_parameter(model: KinematicModel, result: dict[str, Any], paper: PaperFigures) -> str:
    methods = result["methods"]
    rows = [["parameter", *[title for name in methods for title in (name, "paper")]]]
    for parameter in model.parameters:
        row = [f"{parameter.name} [{parameter.unit or 1}]"]
        for name, method in methods.items():
            row.append(_error(method["per_parameter"][parameter.name]))
            row.append(_error(paper.get(name, {}).get(parameter.name)))
        rows.append(row)
    return columns(rows)


def _error(value: float | None) -> str:
    return NONE if value is None else f"{value:.5f}"
