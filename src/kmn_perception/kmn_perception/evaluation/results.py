"""Write the paper's table and plots, with ours, as a page of docs/."""

from __future__ import annotations

import argparse
import os
import shlex
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from kmn_perception.command_line.arguments import output_folder, whole_number, write_json
from kmn_perception.configuration.output import replacing
from kmn_perception.configuration.plain_text import parse_json
from kmn_perception.configuration.section import ConfigurationError
from kmn_perception.evaluation.comparison import LIMIT, Comparison, Request
from kmn_perception.evaluation.evaluate import command, configuration_hash, experiment
from kmn_perception.evaluation.methods import MethodError
from kmn_perception.evaluation.networks import load_networks
from kmn_perception.evaluation.page import (
    PREDICTIONS,
    TRAINING,
    page,
    samples_plot,
    shown_method,
)
from kmn_perception.evaluation.plots.predictions import draw_predictions
from kmn_perception.evaluation.plots.samples import Shown, draw_samples
from kmn_perception.evaluation.plots.training import draw_training
from kmn_perception.evaluation.settings import EvaluationSettings
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.model.sensor_noise import NOISES
from kmn_perception.network.weights import Weights, WeightsError

MODELS = ("box_a", "box_b", "box_c", "door", "box")
WITH_NOISE = ("kmn_paper", "kmn", "kmn_refined", LIMIT)
SHOWN_EXTREMES = 2  # best and worst samples to draw

Results = dict[str, dict[str, dict[str, Any]]]  # [noise][model]


def arguments(argv: Sequence[str] | None = None) -> argparse.Namespace:
    """Parse the command line."""
    parser = argparse.ArgumentParser(prog="results", description=__doc__)
    parser.add_argument("--samples", type=whole_number(1), default=2000, help="default 2000")
    parser.add_argument("--seed", type=whole_number(0), default=0, help="of samples (default 0)")
    parser.add_argument(
        "--out", type=output_folder, default=Path("docs/results"), help="default docs/results"
    )
    parser.add_argument("--models", nargs="+", default=MODELS, choices=MODELS, help="default: all")
    parser.add_argument("--anew", action="store_true", help="do not take over earlier results")
    parser.add_argument(
        "--jobs", type=whole_number(1), default=os.cpu_count() or 1, help="processes (default: all)"
    )
    return parser.parse_args(argv)


def result_of(
    request: Request, samples: int, jobs: int, file: Path, anew: bool, settings: EvaluationSettings
) -> dict[str, Any]:
    """Return what an evaluation yields; what it yielded before, if nothing has changed since."""
    networks = load_networks(KinematicModel.load(request.model))
    expected = {
        "command": command(request, samples),
        "weights": networks.hashes,
        "configuration": configuration_hash(request.model),
    }
    if file.is_file() and not anew:
        earlier = _read(file)
        if {key: earlier.get(key) for key in expected} == expected:
            print(f"{file}: taken over, nothing has changed", file=sys.stderr)
            return earlier
    _, result = experiment(request, samples, settings).run(jobs)
    write_json(file, result)
    return result


def _read(file: Path) -> dict[str, Any]:
    """Return what an evaluation wrote; nothing if that is damaged."""
    try:
        result = parse_json(file.read_bytes())
    except ValueError:
        result = None
    return result if isinstance(result, dict) else {}


def draw_extremes(result: dict[str, Any], settings: EvaluationSettings, file: Path) -> None:
    """Draw the samples on which the network did best and worst."""
    name = shown_method(result)
    if name is None:
        return
    request = Request(result["model"], result["seed"], result["noise"], (name,))
    comparison = Comparison(request, settings)
    shown = []
    for kind in ("best", "worst"):
        for index in result["methods"][name][kind][:SHOWN_EXTREMES]:
            observation, truth = comparison.sample(index)
            values = comparison.estimates(name, observation)[-1]
            error = np.abs(comparison.model.nearest_equivalent(values, truth) - truth).sum()
            shown.append(Shown(observation, values, f"{kind}: sample {index}\nerror {error:.4f}"))
    draw_samples(comparison.model, shown, file)


def draw_losses(models: Sequence[str], file: Path) -> None:
    """Draw the training of all networks that there are."""
    metadata: dict[str, dict[str, Any]] = {"paper": {}, "own": {}}
    for name in models:
        networks = load_networks(KinematicModel.load(name))
        for role, loaded in (("paper", networks.paper), ("own", networks.own)):
            metadata[role][name] = loaded.metadata if isinstance(loaded, Weights) else {}
    draw_training(metadata, file)


def regenerate(options: argparse.Namespace) -> None:
    """Evaluate what is not evaluated yet, and write the page with its plots."""
    settings, folder = EvaluationSettings.load(), options.out
    folder.mkdir(parents=True, exist_ok=True)
    results: Results = {noise: {} for noise in NOISES}
    for noise in NOISES:
        for model in options.models:
            methods = None if noise == "none" else WITH_NOISE
            request = Request(
                model, options.seed, noise, methods, peers=methods is None, lenient=True
            )
            file = folder / f"{model}_{noise}.json"
            results[noise][model] = result_of(
                request, options.samples, options.jobs, file, options.anew, settings
            )
    exact = results["none"]
    draw_losses(options.models, folder / TRAINING)
    draw_predictions(list(exact.values()), folder / PREDICTIONS)
    for model, result in exact.items():
        draw_extremes(result, settings, folder / samples_plot(model))
    again = f"./run kmn_perception results --samples {options.samples} --seed {options.seed}"
    if tuple(options.models) != MODELS:
        again += f" --models {shlex.join(options.models)}"
    with replacing(folder / "README.md") as new:
        new.write_text(page(results, settings.paper, again), encoding="utf-8")
    print(f"wrote {folder / 'README.md'} with its plots")


def main(argv: Sequence[str] | None = None) -> None:
    """Run the executable; an interrupted one goes on where it was."""
    options = arguments(argv)
    try:
        regenerate(options)
    except KeyboardInterrupt:
        sys.exit("results: interrupted; the same command goes on with what is missing")
    except (ConfigurationError, MethodError, OSError, WeightsError) as error:
        sys.exit(f"results: {error}")
