"""Measure how well morphing parameters are estimated, beside the paper."""

from __future__ import annotations

import argparse
import math
import os
import shlex
import sys
from collections.abc import Callable, Iterator, Sequence
from datetime import datetime, timezone
from functools import partial
from typing import Any, Protocol, TypeVar

from tqdm import tqdm

from kmn_perception.command_line.arguments import output_file, whole_number, write_json
from kmn_perception.configuration import resources
from kmn_perception.configuration.section import ConfigurationError
from kmn_perception.evaluation.comparison import NAMES, Comparison, Request
from kmn_perception.evaluation.doors.room_comparison import (
    ROOM_METHODS,
    ROOM_NOISES,
    RoomComparison,
)
from kmn_perception.evaluation.doors.room_statistics import statistics
from kmn_perception.evaluation.doors.room_tables import room_report
from kmn_perception.evaluation.hashes import short_hash
from kmn_perception.evaluation.methods import MethodError
from kmn_perception.evaluation.moved import evaluate_moved, moved_report, state
from kmn_perception.evaluation.settings import EvaluationSettings
from kmn_perception.evaluation.table import report
from kmn_perception.evaluation.tally import Tally
from kmn_perception.model.room_model import has_surroundings
from kmn_perception.model.sensor_noise import NOISES
from kmn_perception.network.threads import use_one_thread
from kmn_perception.network.weights import WeightsError
from kmn_perception.training.processes import in_order

WORTHWHILE = 50  # samples of a process; for fewer its start, some seconds, does not pay

Measured = TypeVar("Measured", covariant=True)


class Compares(Protocol[Measured]):
    """What compares methods on one sample after the other."""

    noise: str
    left_out: dict[str, str]

    def __call__(self, index: int) -> Measured:
        """Return what is measured on a sample."""
        ...


def arguments(argv: Sequence[str] | None = None) -> argparse.Namespace:
    """Parse the command line."""
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
    parser.add_argument("--json", type=output_file, help="file to write the result to")
    parser.add_argument(
        "--jobs", type=whole_number(1), default=os.cpu_count() or 1, help="processes (default: all)"
    )
    return parser.parse_args(argv)


def evaluate(
    request: Request, samples: int, jobs: int, settings: EvaluationSettings
) -> dict[str, Any]:
    """Return the statistics of all methods on samples of their own, as written to JSON."""
    comparison = Comparison(request, settings)
    tallies = {
        name: Tally(comparison.model, counted, settings)
        for name, counted in comparison.counted.items()
    }
    make = partial(Comparison, request, settings)
    for visible, measured in _measured(comparison, make, comparison.model.name, samples, jobs):
        for method, measurement in measured.items():
            tallies[method].add(visible, measurement)
    return {
        **_heading(request, samples, comparison.model.name, comparison.noise),
        "weights": comparison.networks.hashes,
        "configuration": configuration_hash(request.model),
        "methods": {method: tally.summary() for method, tally in tallies.items()},
    }


def evaluate_rooms(request: Request, samples: int, jobs: int) -> dict[str, Any]:
    """Return the statistics of all methods on rendered rooms, as written to JSON.

    Parameters
    ----------
    samples
        Number of rooms with a door; rooms without one are added.
    """
    comparison = RoomComparison(request, samples)
    name, settings = comparison.model.model.name, comparison.settings
    rooms = samples + math.ceil(settings.negatives * samples)
    make = partial(RoomComparison, request, samples)
    measured = list(_measured(comparison, make, name, rooms, jobs))
    return {
        **_heading(request, samples, name, comparison.noise),
        "weights": comparison.hashes,
        "configuration": configuration_hash(request.model),
        **statistics(measured, comparison.methods, settings),
    }


def _measured(
    comparison: Compares[Measured],
    make: Callable[[], Compares[Measured]],
    name: str,
    samples: int,
    jobs: int,
) -> Iterator[Measured]:
    """Yield what is measured on each sample, and show how far it is."""
    for method, reason in comparison.left_out.items():
        print(f"{method} is left out: {reason}", file=sys.stderr)
    with tqdm(
        total=samples,
        desc=f"evaluate {name} ({comparison.noise})",
        unit=" samples",
        mininterval=1.0,
    ) as bar:
        use_one_thread()
        for measured in in_order(make, range(samples), jobs, WORTHWHILE):
            yield measured
            bar.update()


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


def main(argv: Sequence[str] | None = None) -> None:
    """Run the executable."""
    options = arguments(argv)
    try:
        settings = EvaluationSettings.load()
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
            result = evaluate_moved(request, options.states, options.samples)
            print(moved_report(result))
        elif has_surroundings(options.model):
            result = evaluate_rooms(request, options.samples, options.jobs)
            print(room_report(result))
        else:
            result = evaluate(request, options.samples, options.jobs, settings)
            print(report(result, settings.paper.get(result["model"], {})))
        if options.json:
            write_json(options.json, result)
    except KeyboardInterrupt:
        sys.exit("evaluate: interrupted")
    except (ConfigurationError, MethodError, OSError, WeightsError) as error:
        sys.exit(f"evaluate: {error}")
