"""Train the network of a model and write its weight file."""

from __future__ import annotations

import argparse
import dataclasses
import shutil
import signal
from typing import Any

import torch

from kmn_perception.command_line.arguments import output_file, output_folder, whole_number
from kmn_perception.configuration import resources
from kmn_perception.configuration.section import Section
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.network import weights
from kmn_perception.network.designs import DESIGNS
from kmn_perception.network.morph_network import MorphNetwork
from kmn_perception.sharing.experiment import add_jobs
from kmn_perception.training.procedures import load_training_settings, procedure_of
from kmn_perception.training.run import Run, run_to_end
from kmn_perception.training.settings import SharedSettings, TrainingSettings
from kmn_perception.training.training import Training
from kmn_perception.training.workers import Workers

DEFAULT = "default"  # settings for any model
CHANGES = ("network", "samples", "epochs", "retrain_epochs", "rounds", "seed")


def arguments(argv: list[str] | None = None) -> argparse.Namespace:
    """Parse the command line."""
    parser = argparse.ArgumentParser(prog="train", description=__doc__)
    count, positive = whole_number(0), whole_number(1)
    parser.add_argument("--model", required=True, help="name or YAML file of the kinematic model")
    parser.add_argument("--out", required=True, type=output_file, help="weight file to write")
    parser.add_argument(
        "--config", help="name or YAML file of the settings (default: the model's, or `default`)"
    )
    parser.add_argument("--start", help="name or weight file whose network is trained on")
    parser.add_argument("--network", choices=DESIGNS, help="design in place of the settings'")
    parser.add_argument("--samples", type=whole_number(10), help="N_data in place of the settings'")
    parser.add_argument("--epochs", type=positive, help="epochs of the first round")
    parser.add_argument("--retrain-epochs", type=positive, help="epochs of each later round")
    parser.add_argument("--rounds", type=count, help="largest number of later rounds")
    parser.add_argument("--seed", type=count, help="seed of data, initialisation and order")
    parser.add_argument(
        "--run", type=output_folder, help="folder of the run (default: beside --out)"
    )
    parser.add_argument("--restart", action="store_true", help="discard an earlier run")
    parser.add_argument("--device", default="auto", choices=("auto", "cpu", "cuda"))
    parser.add_argument("--threads", type=positive, default=1, help="threads of torch")
    add_jobs(parser)
    return parser.parse_args(argv)


def settings_of(options: argparse.Namespace) -> TrainingSettings:
    """Return the settings of the file with those of the command line in their place.

    Without ``--config`` they are those shipped for the model and the given design, if there are
    any, else those of the model, else those for any model.
    """
    given = {name: getattr(options, name) for name in CHANGES}
    changes = {name: value for name, value in given.items() if value is not None}
    shipped = resources.share_directory() / "config/training"
    names = (f"{options.network}/{options.model}", options.model)
    known = (name for name in names if (shipped / f"{name}.yaml").is_file())
    return load_training_settings(options.config or next(known, DEFAULT), changes)


def train(options: argparse.Namespace) -> None:
    """Train as the options say, and write the weight file."""
    model, settings, shared = (
        KinematicModel.load(options.model), settings_of(options), SharedSettings.load(),
    )  # fmt: skip
    folder = options.run or options.out.with_suffix(".run")
    torch.set_num_threads(options.threads)
    torch.manual_seed(settings.seed)
    network, baseline, origin = _networks(model, settings, options.start)
    with Workers(options.device) as workers:
        if options.restart and workers.rank == 0 and folder.exists():
            shutil.rmtree(folder)
        known = {
            **weights.describe(model),
            "training": dataclasses.asdict(settings),
            **origin,
        }
        run = Run(folder, {**known, "processes": workers.count}, shared.checkpoint_seconds)
        for interruption in (signal.SIGINT, signal.SIGTERM):
            signal.signal(interruption, run.interrupt)
        training = procedure_of(settings.network)(
            network, settings, shared.validation, run, workers, options.jobs, baseline
        )
        workers.say(
            f"training '{model.name}' on {workers.device}; curves and checkpoints: {folder}"
        )
        training.train()
        if workers.rank == 0:
            weights.save(options.out, _result(training, known))
            workers.say(f"wrote {options.out}")


def _networks(
    model: KinematicModel, settings: TrainingSettings, start: str | None
) -> tuple[MorphNetwork, MorphNetwork | None, dict[str, Any]]:
    """Return the network that the training begins with, its baseline, and what is said of them."""
    design = Section(settings.design, "training settings: design")
    untrained = DESIGNS[settings.network].untrained(model, design)
    if start is None:
        return untrained, None, {}
    given = weights.load(start, model)
    if _design(given.network) != _design(untrained):
        raise weights.WeightsError(
            f"{start} cannot be trained on with these settings: its network is "
            f"{_design(given.network)}, theirs {_design(untrained)}"
        )
    known = ("training", "errors", "start")
    origin = {key: given.metadata[key] for key in known if key in given.metadata}
    return given.network.requires_grad_(True), given.baseline, {"start": origin}


def _design(network: MorphNetwork) -> dict[str, Any]:
    """Return what a network is, but for how far it is grown."""
    described = {key: value for key, value in network.describe().items() if key != "stages"}
    return {"network": network.name, **described}


def _result(training: Training, known: dict[str, Any]) -> weights.Weights:
    state, networks = training.state, training.networks
    metadata = {
        **known,
        "errors": {"by_round_and_step": state.errors, "samples": "validation, never trained on"},
        "losses": state.losses,
        "seconds": round(state.seconds),
    }
    baseline = networks.get("baseline")
    return weights.Weights(training.network.cpu(), baseline and baseline.cpu(), metadata)


def main() -> None:
    """Run the executable; an interrupted run is resumed by the same command."""
    options = arguments()
    run_to_end("train", lambda: train(options))
