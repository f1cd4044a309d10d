"""The page of the results, in Markdown."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from kmn_perception.command_line.columns import NONE
from kmn_perception.evaluation.settings import PaperErrors
from kmn_perception.evaluation.table import (
    PAPER_METHOD,
    Rows,
    by_parameter,
    by_visible_fraction,
    error,
    summary,
)

TRAINING, PREDICTIONS = "training.png", "predictions.png"

METHODS = """\
| method | what it is |
| --- | --- |
| `baseline` | one prediction of the paper's network before its data were augmented |
| `kmn_paper` | 5 predictions of the paper's network after Algorithm 2 |
| `kmn` | our network, all its stages |
| `kmn_refined` | the kinematic model fitted to the observation, from our network's estimate |
| `multistart` | the same fit without a network, from many starts |
| `icp` | open3d, point-to-point, from where the centres of the clouds meet; this row counts |
| `icp_identity` | the same from the identity and wherever it ends, as in the paper |
| `icp_plane` | open3d, point-to-plane, from the centres; it slides along flat faces |
| `small_gicp` | generalised ICP, from the centres |
| `information_limit` | the middle of all parameters that look the same as the truth |

Registrations know no scales and no gamma, so these stay 0; all but `icp_identity` are kept within
the model's limits. The information limit is what no method could know from an exact depth image of
the whole view; noise, holes and a hidden side come on top. Milliseconds are the median on one
thread. `in 95 %` is the share of samples whose truth lies within the 95 % ellipsoid of the
method's own covariance.
"""


def samples_plot(model: str) -> str:
    """Return the name of the plot of a model's best and worst samples."""
    return f"samples_{model}.png"


def shown_method(result: Mapping[str, Any]) -> str | None:
    """Return the method whose best and worst samples are shown, if there is one with weights."""
    return next((name for name in ("kmn", "kmn_paper") if name in result["methods"]), None)


def page(
    results: Mapping[str, Mapping[str, dict[str, Any]]],
    paper: Mapping[str, PaperErrors],
    command: str,
) -> str:
    """Return the page.

    Parameters
    ----------
    results
        By noise (``none`` and others) and model, as written to JSON.
    paper
        The errors that the paper reports, by model.
    command
        Makes the page again.
    """
    exact = results["none"]
    parts = [
        "# Results",
        _origin(results, command),
        "Errors are the sum over the parameters of absolute errors (metres, radians, scales), on "
        "samples that never trained.",
        "## Mean errors, and the paper's in brackets",
        markdown(_overview(exact, paper)),
        METHODS.rstrip(),
        "## Over the number of predictions",
        f"![Error over the number of predictions]({PREDICTIONS})",
        "Mean over all samples; the bars reach one standard deviation upwards.",
    ]
    for model, result in exact.items():
        parts += _scene(model, result, paper.get(model, {}))
    parts.append("## With noise")
    for noise, by_model in results.items():
        if noise != "none":
            parts += [f"### {noise}", markdown(_noisy(by_model))]
    parts += [
        "## Training",
        f"![Training losses over time]({TRAINING})",
        "The loss of each round in its colour, thin as it was and thick averaged; with it the "
        "error on validation samples after the round. The rounds of the paper's network are the "
        "retrainings of Algorithm 2, those of ours its stages. The loss of ours is relative to "
        "what is left for a stage to predict, so that the losses of two stages do not compare.",
        markdown(_weights(exact)),
    ]
    return "\n\n".join(parts) + "\n"


def markdown(rows: Rows) -> str:
    """Return rows as a table whose first row is its head."""
    lines = [f"| {' | '.join(row)} |" for row in rows]
    return "\n".join([lines[0], "|" + " --- |" * len(rows[0]), *lines[1:]])


def _origin(results: Mapping[str, Mapping[str, dict[str, Any]]], command: str) -> str:
    every = [result for by_model in results.values() for result in by_model.values()]
    last = max(result["date"] for result in every)
    return (
        f"Written by `{command}` (as by `make evaluate`) on {last[:10]}; "
        f"{every[0]['samples']} samples, seed {every[0]['seed']}. The JSON files beside this page "
        "hold all statistics, and the command that yields them."
    )


def _overview(exact: Mapping[str, dict[str, Any]], paper: Mapping[str, PaperErrors]) -> Rows:
    names = dict.fromkeys(name for result in exact.values() for name in result["methods"])
    rows = [["method", *exact]]
    for name in names:
        row = [f"`{name}`"]
        for model, result in exact.items():
            method = result["methods"].get(name)
            reported = paper.get(model, {}).get(PAPER_METHOD.get(name, ""), {}).get("mean")
            beside = "" if reported is None else f" ({reported:.5f})"
            row.append(NONE if method is None else error(method["mean"]) + beside)
        rows.append(row)
    return rows


def _scene(model: str, result: dict[str, Any], paper: PaperErrors) -> list[str]:
    parts = [
        f"## {model}",
        markdown(summary(result, paper)),
        "Mean by the share of the object that is in the image:",
        markdown(by_visible_fraction(result)),
        "Mean absolute error of each parameter:",
        markdown(by_parameter(result, paper)),
    ]
    if shown_method(result):
        parts += [
            f"![Best and worst samples, before and after morphing]({samples_plot(model)})",
            "What the canonical camera sees of the points, above as observed, with the prototype's "
            "contour, and below morphed by the estimate, with the contour at the estimated gamma.",
        ]
    return parts


def _noisy(by_model: Mapping[str, dict[str, Any]]) -> Rows:
    rows = [["model", "method", "mean", "median", "p95", "in 95 %"]]
    for model, result in by_model.items():
        for row in summary(result, {})[1:]:
            rows.append([model, *row[:4], row[6]])
    return rows


def _weights(exact: Mapping[str, dict[str, Any]]) -> Rows:
    rows = [["model", "paper's network, sha256", "our network, sha256"]]
    for model, result in exact.items():
        hashes = [result["weights"].get(role, NONE) for role in ("paper", "own")]
        rows.append([model, *hashes])
    return rows
