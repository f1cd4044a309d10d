"""Measure how well morphing parameters are estimated, beside the paper."""

from __future__ import annotations

import argparse
import math
import os
import shlex
import sys
from collections.abc import Mapping, Sequence
from datetime import datetime, timezone
from functools import partial
from typing import Any

from kmn_perception.command_line.arguments import whole_number
from kmn_perception.configuration import resources
from kmn_perception.configuration.hashes import short_hash
from kmn_perception.configuration.section import ConfigurationError
from kmn_perception.evaluation.comparison import NAMES, Comparison, Measurement, Request
from kmn_perception.evaluation.doors.room_comparison import (
    ROOM_METHODS,
    ROOM_NOISES,
    RoomComparison,
    RoomSample,
)
from kmn_perception.evaluation.doors.room_statistics import statistics
from kmn_perception.evaluation.doors.room_tables import room_report
from kmn_perception.evaluation.methods import MethodError
from kmn_perception.evaluation.moved import moved_experiment, state
from kmn_perception.evaluation.settings import EvaluationSettings
from kmn_perception.evaluation.table import report
from kmn_perception.evaluation.tally import Tally
from kmn_perception.model.room_model import has_surroundings
from kmn_perception.model.sensor_noise import NOISES
from kmn_perception.network.weights import WeightsError
from kmn_perception.sharing.experiment import ExperimentCommand, SharedExperiment

WORTHWHILE = 50  # samples of a process; for fewer its start, some seconds, does not pay


def parser() -> argparse.ArgumentParser:
    """Return the parser of what is to be evaluated."""
    parser = argparse.ArgumentParser(prog="evaluate", description=__doc__)
    parser.add_argument("--model", required=True, help="name or YAML file of the kinematic model")
    parser.add_argument("--samples", type=whole_number(1), default=2000, help="default 2000")
    parser.add_argument("--seed", type=whole_number(0), default=0, help="of samples (default 0)")
    parser.add_argument(
        "--noise",
        choices=dict.fromkeys((*NOISES, *ROOM_NOISES)),
        help="of the sensor (default: as in training; of rooms d455)",
    )
    parser.add_argument("--weights", help="file for our network (default: the one shipped)")
    parser.add_argument("--paper-weights", help="file for the paper's network (default: shipped)")
    parser.add_argument(
        "--methods",
        nargs="+",
        choices=(*NAMES, *ROOM_METHODS),
        help="default: all that apply, but for the peers",
    )
    parser.add_argument(
        "--peers",
        action="store_true",
        help="compare with the slow peers too: ICP, and the fit without a network",
    )
    parser.add_argument(
        "--states",
        nargs="+",
        type=state,
        metavar="JOINT=POSITION",
        help="see the object with a joint moved, and tell what the estimates of that are worth",
    )
    return parser


def experiment(
    request: Request, samples: int, settings: EvaluationSettings
) -> SharedExperiment[tuple[float, dict[str, Measurement]]]:
    """Return what compares all methods on samples of a model."""
    comparison = Comparison(request, settings)
    model = comparison.model
    _tell(comparison.left_out)

    def conclude(found: list[tuple[float, dict[str, Measurement]]]) -> tuple[str, Any]:
        tallies = {
            name: Tally(model, counted, settings) for name, counted in comparison.counted.items()
        }
        for visible, measured in found:
            for method, measurement in measured.items():
                tallies[method].add(visible, measurement)
        result = {
            **_heading(request, samples, model.name, comparison.noise),
            "weights": comparison.networks.hashes,
            "configuration": configuration_hash(request.model),
            "methods": {method: tally.summary() for method, tally in tallies.items()},
        }
        return report(result, settings.paper.get(model.name, {})), result

    return SharedExperiment(
        title=f"evaluate {model.name} ({comparison.noise})",
        unit="samples",
        items=samples,
        kind=tuple[float, dict[str, Measurement]],
        make=partial(Comparison, request, settings),
        conclude=conclude,
        worthwhile=WORTHWHILE,
        depends_on=comparison.networks.hashes,
    )


def room_experiment(request: Request, samples: int) -> SharedExperiment[RoomSample]:
    """Return what compares all methods on rendered rooms.

    Parameters
    ----------
    samples
        Number of rooms with a door; rooms without one are added.
    """
    comparison = RoomComparison(request, samples)
    name, settings = comparison.model.model.name, comparison.settings
    _tell(comparison.left_out)

    def conclude(found: list[RoomSample]) -> tuple[str, Any]:
        result = {
            **_heading(request, samples, name, comparison.noise),
            "weights": comparison.hashes,
            "configuration": configuration_hash(request.model),
            **statistics(found, comparison.methods, settings),
        }
        return room_report(result), result

    return SharedExperiment(
        title=f"evaluate {name} ({comparison.noise})",
        unit="rooms",
        items=samples + math.ceil(settings.negatives * samples),
        kind=RoomSample,
        make=partial(RoomComparison, request, samples),
        conclude=conclude,
        worthwhile=WORTHWHILE,
        depends_on=comparison.hashes,
    )


def _tell(left_out: Mapping[str, str]) -> None:
    for method, reason in left_out.items():
        print(f"{method} is left out: {reason}", file=sys.stderr)


def _heading(request: Request, samples: int, name: str, noise: str) -> dict[str, Any]:
    """Return what is written first: what was evaluated, when, and by which command."""
    return {
        "model": name,
        "samples": samples,
        "seed": request.seed,
        "noise": noise,
        "date": datetime.now(timezone.utc).isoformat(timespec="seconds"),
        "command": command(request, samples),
    }


def command(request: Request, samples: int) -> str:
    """Return the command that evaluates as requested."""
    words = ["--model", request.model, "--samples", str(samples), "--seed", str(request.seed)]
    for option, value in (
        ("--noise", request.noise),
        ("--weights", request.weights),
        ("--paper-weights", request.paper_weights),
    ):
        words += [option, value] if value else []
    if request.methods is not None:
        words += ["--methods", *request.methods]
    if request.peers:
        words.append("--peers")
    return f"./run kmn_perception evaluate {shlex.join(words)}"


def configuration_hash(model: str) -> str:
    """Return a short hash of all that the results depend on beside the weights and the code."""
    names: tuple[str, ...] = ("evaluation", "refinement")
    if has_surroundings(model):
        names = ("doors", "rooms", "door_errors", "room_evaluation")
    return short_hash(
        resources.find("config/models", model), *(resources.find("config", name) for name in names)
    )


def prepare(options: argparse.Namespace) -> SharedExperiment[Any]:
    """Return the experiment that the options tell."""
    request = Request(
        model=options.model,
        seed=options.seed,
        noise=options.noise,
        methods=options.methods and tuple(options.methods),
        peers=options.peers,
        weights=options.weights,
        paper_weights=options.paper_weights,
    )
    if options.states:
        return moved_experiment(request, options.states, options.samples)
    if has_surroundings(options.model):
        return room_experiment(request, options.samples)
    return experiment(request, options.samples, EvaluationSettings.load())


COMMAND = ExperimentCommand(
    package="kmn_perception",
    name="evaluate",
    parser=parser,
    prepare=prepare,
    expected=(ConfigurationError, MethodError, WeightsError),
    jobs=os.cpu_count() or 1,
)


def main(argv: Sequence[str] | None = None) -> None:
    """Run the executable."""
    COMMAND.start(argv)
