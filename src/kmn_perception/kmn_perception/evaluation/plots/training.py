"""The training error over time, in a colour for each round (the paper's figure)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from kmn_perception.evaluation.plots.style import figure

PANEL = 4.3, 1.9  # inches
COLUMNS = {"paper": "the paper's network", "own": "our network"}
DRAWN = 150  # losses of a round are drawn one by one, evenly spread
SMOOTHED = 15  # a part of this many of a round's losses is averaged for reading


def draw_training(metadata: Mapping[str, Mapping[str, Mapping[str, Any]]], file: Path) -> None:
    """Draw the loss over the time of training, with the validation error after each round.

    Parameters
    ----------
    metadata
        Of weight files, by ``paper`` and ``own`` and by model.
    """
    models = list(dict.fromkeys(model for by_model in metadata.values() for model in by_model))
    with figure(file, len(models), len(COLUMNS), PANEL) as made:
        grid = made.subplots(len(models), len(COLUMNS), squeeze=False)
        for axes, title in zip(grid[0], COLUMNS.values(), strict=True):
            axes.set_title(title)
        for axes in grid[-1]:
            axes.set_xlabel("minutes of training")
        for row, model in zip(grid, models, strict=True):
            row[0].set_ylabel(f"{model}\nloss")
            for axes, role in zip(row, COLUMNS, strict=True):
                known = metadata.get(role, {}).get(model, {})
                if known.get("losses"):
                    _draw(axes, known, role)
                else:
                    axes.text(0.5, 0.5, "not known", ha="center", transform=axes.transAxes)
                    axes.set(xticks=[], yticks=[])


def _draw(axes: Axes, metadata: Mapping[str, Any], role: str) -> None:
    minutes, rounds, losses = np.array(metadata["losses"]).T / [[60.0], [1.0], [1.0]]
    errors: Sequence[Sequence[float]] = metadata["errors"]["by_round_and_step"]
    colours = mpl.colormaps["viridis"](np.linspace(0.0, 0.85, len(errors)))
    for number, (by_step, colour) in enumerate(zip(errors, colours, strict=True)):
        at, mine = minutes[rounds == number], losses[rounds == number]
        few = np.unique(np.linspace(0, len(mine) - 1, DRAWN).astype(int))
        axes.plot(at[few], mine[few], color=colour, alpha=0.25, linewidth=0.6)
        label = f"{_name(role, number)}: error {by_step[-1]:.5f}"
        axes.plot(at, smooth(mine), color=colour, linewidth=1.5, label=label)
    axes.set(yscale="log")
    axes.legend(loc="best")


def _name(role: str, number: int) -> str:
    if role == "own":
        return f"stage {number + 1}"
    return f"retraining {number}" if number else "first training"


def smooth(losses: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return geometric means over neighbours; at the ends over fewer."""
    reach = len(losses) // SMOOTHED
    sums = np.concatenate(([0.0], np.cumsum(np.log(losses))))
    first = np.maximum(np.arange(len(losses)) - reach, 0)
    last = np.minimum(np.arange(len(losses)) + reach + 1, len(losses))
    means: NDArray[np.float64] = np.exp((sums[last] - sums[first]) / (last - first))
    return means
