"""The statistics of one method over all samples."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kmn_perception.evaluation.comparison import Measurement
from kmn_perception.evaluation.settings import EvaluationSettings
from kmn_perception.model.kinematic_model import KinematicModel


class Tally:
    """Gathers how well a method did, sample by sample.

    Parameters
    ----------
    counted
        Number of the step whose estimate is the result.
    """

    def __init__(self, model: KinematicModel, counted: int, settings: EvaluationSettings) -> None:
        self._model, self._counted, self._settings = model, counted, settings
        self._measurements: list[Measurement] = []
        self._visible: list[float] = []

    def add(self, visible: float, measurement: Measurement) -> None:
        """Add a sample with the fraction of the object that is visible."""
        self._visible.append(visible)
        self._measurements.append(measurement)

    def summary(self) -> dict[str, Any]:
        """Return the statistics of all samples, as written to JSON."""
        errors = np.stack([measurement.errors for measurement in self._measurements])
        sums = errors.sum(axis=2)
        result = sums[:, self._counted]
        counted = errors[:, self._counted]
        means, medians = counted.mean(axis=0), np.median(counted, axis=0)
        names = [parameter.name for parameter in self._model.parameters]
        order = np.argsort(result, kind="stable")
        extremes = self._settings.extremes
        return {
            "samples": len(result),
            **_statistics(result),
            "per_parameter": dict(zip(names, means.tolist(), strict=True)),
            "per_parameter_median": dict(zip(names, medians.tolist(), strict=True)),
            "by_step": sums.mean(axis=0).tolist(),
            "by_step_std": sums.std(axis=0).tolist(),
            "by_visible_fraction": self._by_visible_fraction(result),
            **self._coverage(),
            "best": order[:extremes].tolist(),
            "worst": order[::-1][:extremes].tolist(),
            "milliseconds": 1e3 * float(np.median([m.seconds for m in self._measurements])),
        }

    def _by_visible_fraction(self, errors: NDArray[np.float64]) -> list[dict[str, Any]]:
        limits = self._settings.visible_bins
        bins = np.searchsorted(limits[1:-1], self._visible, side="right")
        return [
            {
                "low": low,
                "high": high,
                "samples": int((bins == i).sum()),
                **_statistics(errors[bins == i]),
            }
            for i, (low, high) in enumerate(pairwise(limits))
        ]

    def _coverage(self) -> dict[str, float]:
        covered = [m.covered for m in self._measurements if m.covered is not None]
        return {"coverage95": float(np.mean(covered))} if covered else {}


def _statistics(errors: NDArray[np.float64]) -> dict[str, float | None]:
    if not len(errors):
        return {"mean": None, "median": None, "p95": None}
    return {
        "mean": float(errors.mean()),
        "median": float(np.median(errors)),
        "p95": float(np.percentile(errors, 95)),
    }
