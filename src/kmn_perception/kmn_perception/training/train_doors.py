"""Train the network that proposes doors in walls, on rendered rooms, and write its weight file."""

from __future__ import annotations

import argparse
import dataclasses
import shutil
import signal

import torch

from kmn_perception.command_line.arguments import output_file, output_folder, whole_number
from kmn_perception.doors.settings import DoorSettings
from kmn_perception.doors.view_cells import describe_cells
from kmn_perception.network import wall_weights
from kmn_perception.network.threads import use_one_thread
from kmn_perception.network.wall_network import WallNetwork
from kmn_perception.sharing.experiment import add_jobs, add_shard
from kmn_perception.sharing.plain import to_plain
from kmn_perception.sharing.records import WHOLE
from kmn_perception.training.run import Run, run_to_end
from kmn_perception.training.settings import SharedSettings
from kmn_perception.training.wall.fitting import Fitting
from kmn_perception.training.wall.settings import WallTrainingSettings
from kmn_perception.training.wall.shards import data_depend_on, make_shards, read_shards


def arguments(argv: list[str] | None = None) -> argparse.Namespace:
    """Parse the command line."""
    parser = argparse.ArgumentParser(prog="train_doors", description=__doc__)
    positive = whole_number(1)
    parser.add_argument("--out", required=True, type=output_file, help="weight file to write")
    parser.add_argument(
        "--config",
        default=DoorSettings.load().model,
        help="name or YAML file of the settings (default: those of the shipped weights)",
    )
    parser.add_argument("--rooms", type=whole_number(2), help="in place of the settings'")
    parser.add_argument("--epochs", type=positive, help="in place of the settings'")
    parser.add_argument("--seed", type=whole_number(0), help="in place of the settings'")
    parser.add_argument(
        "--run", type=output_folder, help="folder of the run (default: beside --out)"
    )
    parser.add_argument("--restart", action="store_true", help="discard an earlier run")
    add_jobs(parser)
    add_shard(parser)
    return parser.parse_args(argv)


def settings_of(options: argparse.Namespace) -> WallTrainingSettings:
    """Return the settings of the file with those of the command line in their place."""
    settings = WallTrainingSettings.load(options.config)
    data, fit = settings.data, settings.fit
    return dataclasses.replace(
        settings,
        seed=settings.seed if options.seed is None else options.seed,
        data=data._replace(rooms=options.rooms or data.rooms),
        fit=fit._replace(epochs=options.epochs or fit.epochs),
    )


def train(options: argparse.Namespace) -> None:
    """Train as the options say, and write the weight file; of a shard, render the data only."""
    settings, doors = settings_of(options), DoorSettings.load()
    folder = options.run or options.out.with_suffix(".run")
    if options.restart and folder.exists():
        shutil.rmtree(folder)
    cells = describe_cells(doors)
    known = {"training": to_plain(settings), "cells": cells}
    seconds = SharedSettings.load().checkpoint_seconds
    run = Run(folder, {**known, "depends_on": data_depend_on(doors)}, seconds)
    for interruption in (signal.SIGINT, signal.SIGTERM):
        signal.signal(interruption, run.interrupt)
    data = folder / "data"
    files = make_shards(data, settings, doors, options.jobs, lambda: run.interrupted, options.shard)
    if options.shard != WHOLE:
        print(f"{data} holds shard {options.shard}: {len(files)} files; training needs all of them")
        return
    samples, held_out = read_shards(files, settings, doors)
    print(f"{len(samples)} views to train on, {len(held_out)} held out; the run: {folder}")
    use_one_thread()
    torch.manual_seed(settings.seed)
    network = WallNetwork(settings.width)
    high, wide = (cells["pixel"] * count for count in cells["pixels"])
    fitting = Fitting(network, samples, held_out, settings, (high, wide), run)
    fitting.fit()
    state = fitting.state
    metadata = {
        "model": doors.model,
        "training": known["training"],
        "views": len(samples),
        "errors": {**state.epochs[-1], "samples": "rooms that never trained"},
        "epochs": state.epochs,
        "seconds": round(state.seconds),
    }
    wall_weights.save(options.out, wall_weights.WallWeights(network, cells, metadata))
    print(f"wrote {options.out}")


def main() -> None:
    """Run the executable; an interrupted run is resumed by the same command."""
    options = arguments()
    run_to_end("train_doors", lambda: train(options))
