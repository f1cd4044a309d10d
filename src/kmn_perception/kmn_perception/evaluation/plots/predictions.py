"""The error over the number of predictions (the paper's figure)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes

from kmn_perception.evaluation.plots.style import COLOURS, LABELS, figure

PANEL, COLUMNS = (2.9, 2.3), 3
DRAWN = ("baseline", "kmn_paper", "kmn")


def draw_predictions(results: Sequence[dict[str, Any]], file: Path) -> None:
    """Draw mean and standard deviation of the error after 0, 1, 2, ... predictions.

    Parameters
    ----------
    results
        Of each model, as written to JSON.
    """
    rows, columns = math.ceil(len(results) / COLUMNS), min(len(results), COLUMNS)
    with figure(file, rows, columns, PANEL) as made:
        grid = made.subplots(rows, columns, squeeze=False)
        for axes, result in zip(grid.flat, results, strict=False):
            _draw(axes, result)
        for axes in grid.flat[len(results) :]:
            axes.set_axis_off()
        for axes in grid[:, 0]:
            axes.set_ylabel("sum of absolute errors")
        by_label = {
            label: line
            for axes in grid.flat
            for line, label in zip(*axes.get_legend_handles_labels(), strict=True)
        }
        if by_label:
            made.legend(
                by_label.values(), by_label.keys(), loc="outside lower center", ncols=len(DRAWN)
            )


def _draw(axes: Axes, result: dict[str, Any]) -> None:
    axes.set(title=result["model"], xlabel="number of predictions", yscale="log")
    for i, name in enumerate(DRAWN):
        method = result["methods"].get(name)
        if method is None:
            continue
        steps = [step + 0.12 * (i - 1) for step in range(len(method["by_step"]))]
        up = method["by_step_std"]
        axes.errorbar(  # only upwards: the mean less the deviation is often below 0
            steps,
            method["by_step"],
            yerr=([0.0] * len(up), up),
            color=COLOURS[name],
            label=LABELS[name],
            marker="o",
            markersize=3,
            linewidth=1.2,
            elinewidth=0.8,
            capsize=2,
        )
