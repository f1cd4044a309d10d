"""The ``evaluate`` executable: how well morphing parameters are estimated, beside the paper."""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Mapping
from itertools import islice
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from tqdm import tqdm

from kmn_perception import weights
from kmn_perception.command_line import output_file, whole_number
from kmn_perception.configuration import ConfigurationError
from kmn_perception.evaluation.errors import absolute_errors
from kmn_perception.evaluation.methods import METHODS, Method, MethodError, choose
from kmn_perception.evaluation.settings import EvaluationSettings
from kmn_perception.evaluation.table import report
from kmn_perception.kinematic_model import KinematicModel
from kmn_perception.observation import Observation
from kmn_perception.sensor import NOISES
from kmn_perception.training.samples import EVALUATION, sample
from kmn_perception.training.settings import SensorSettings
from kmn_perception.weights import WeightsError


def arguments(argv: list[str] | None = None) -> argparse.Namespace:
    """Parse the command line."""
    parser = argparse.ArgumentParser(prog="evaluate", description=__doc__)
    parser.add_argument("--model", required=True, help="name or YAML file of the kinematic model")
    parser.add_argument("--samples", type=whole_number(1), default=2000, help="default 2000")
    parser.add_argument("--seed", type=whole_number(0), default=0, help="of samples (default 0)")
    parser.add_argument("--noise", choices=NOISES, help="of the sensor (default: as in training)")
    parser.add_argument("--weights", help="weight file (default: the one shipped with the model)")
    parser.add_argument("--methods", nargs="+", choices=METHODS, help="default: all that apply")
    parser.add_argument("--json", type=output_file, help="file to write the result to")
    return parser.parse_args(argv)


class Tally:
    """The errors and times of one method, gathered sample by sample."""

    def __init__(self, model: KinematicModel, method: Method, steps: int) -> None:
        self._model, self._method, self._steps = model, method, steps
        self._errors: list[NDArray[np.float64]] = []  # each (steps + 1, n + m)
        self._seconds: list[float] = []

    def add(self, observation: Observation, truth: NDArray[np.float64]) -> None:
        """Estimate the parameters of an observation and compare them with the truth (n + m,)."""
        started = time.perf_counter()
        estimates = self._method.estimates(observation)
        values = list(islice(estimates, self._method.counted + 1))
        self._seconds.append(time.perf_counter() - started)
        values += islice(estimates, self._steps - self._method.counted)
        self._errors.append(absolute_errors(self._model, np.stack(values), truth))

    def summary(self) -> dict[str, Any]:
        """Return the figures of all samples."""
        errors = np.stack(self._errors)
        sums = errors.sum(axis=2)
        result = sums[:, self._method.counted]
        means = errors[:, self._method.counted].mean(axis=0)
        names = [parameter.name for parameter in self._model.parameters]
        return {
            "mean": float(result.mean()),
            "median": float(np.median(result)),
            "p95": float(np.percentile(result, 95)),
            "per_parameter": dict(zip(names, means.tolist(), strict=True)),
            "by_step": sums.mean(axis=0).tolist(),
            "milliseconds": 1e3 * float(np.median(self._seconds)),
        }


def sensor_of(metadata: Mapping[str, Any], noise: str | None) -> tuple[SensorSettings | None, str]:
    """Return the sensor that weights were trained for, with its noise or that given instead.

    Without a sensor it is the canonical camera, of which the training has no noise. The camera's
    pose is known here: what it is wrong by, no method could tell.
    """
    trained = metadata.get("training", {}).get("sensor")
    if trained is None:
        return None, noise or "none"
    known = {"noise": noise or trained["noise"], "pose_error": (0.0, 0.0)}
    sensor = SensorSettings(**{**trained, **known})
    return sensor, sensor.noise


def evaluate(
    model: KinematicModel, options: argparse.Namespace, settings: EvaluationSettings
) -> dict[str, Any]:
    """Return the figures of all methods on samples that never trained, as written to JSON."""
    torch.set_num_threads(1)
    loaded = weights.load(options.weights or model.name, model)
    sensor, noise = sensor_of(loaded.metadata, options.noise)
    methods = choose(options.methods, model, loaded, settings)
    tallies = {name: Tally(model, method, settings.steps) for name, method in methods.items()}
    bar = tqdm(
        range(options.samples), desc=f"evaluate {model.name}", unit=" samples", mininterval=1.0
    )
    for index in bar:
        observation, truth = sample(model, options.seed, index, sensor, noise, EVALUATION)
        for tally in tallies.values():
            tally.add(observation, truth)
    return {
        "model": model.name,
        "samples": options.samples,
        "seed": options.seed,
        "noise": noise,
        "methods": {name: tally.summary() for name, tally in tallies.items()},
    }


def main(argv: list[str] | None = None) -> None:
    """Run the executable."""
    options = arguments(argv)
    try:
        model, settings = KinematicModel.load(options.model), EvaluationSettings.load()
        result = evaluate(model, options, settings)
        print(report(model, result, settings.paper.get(model.name, {})))
        if options.json:
            options.json.write_text(json.dumps(result, indent=2) + "\n", encoding="utf-8")
    except KeyboardInterrupt:
        sys.exit("evaluate: interrupted")
    except (ConfigurationError, MethodError, OSError, WeightsError) as error:
        sys.exit(f"evaluate: {error}")


if __name__ == "__main__":
    main()
