"""How well an object is estimated one of whose joints has moved."""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from functools import partial
from statistics import median
from typing import Any, NamedTuple

import numpy as np

from kmn_perception.command_line.columns import columns, text
from kmn_perception.configuration.node_parameters import parameter_values, pick
from kmn_perception.estimate import Status
from kmn_perception.estimator import EstimatorSettings, MorphEstimator
from kmn_perception.evaluation.comparison import CONFIDENCE, Request
from kmn_perception.evaluation.coverage import chi2_quantile, is_covered
from kmn_perception.evaluation.methods import MethodError
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.model.sensor_noise import NOISES
from kmn_perception.network.errors import absolute_errors
from kmn_perception.sharing.experiment import SharedExperiment
from kmn_perception.training.samples import EVALUATION, observe

HEADINGS = ("joint", "OK", "in 95 %", "off, median", "most", "stated", "others, most", "ms")
THOUSAND = 1e3
WORTHWHILE = 20  # samples of a process; for fewer its start, some seconds, does not pay


class State(NamedTuple):
    """A joint and its position, rad or m."""

    joint: str
    position: float


class Outcome(NamedTuple):
    """What an estimate of a sample was worth.

    Attributes
    ----------
    ok
        Whether its status is OK.
    covered
        Whether the truth lies within its ellipsoid, and that of the position within its interval.
    off, stated
        Error of the position, and the standard deviation that is stated, rad or m.
    others
        Largest absolute error of (theta, gamma).
    seconds
        That it took.
    """

    ok: bool
    covered: bool
    off: float
    stated: float
    others: float
    seconds: float


def state(argument: str) -> State:
    """Parse ``JOINT=POSITION``."""
    name, _, position = argument.partition("=")
    try:
        return State(name, float(position))
    except ValueError:
        raise argparse.ArgumentTypeError(
            f"{argument} is not JOINT=POSITION, e.g. hinge=-0.1"
        ) from None


class MovedMeasurement:
    """Estimates objects one of whose joints has moved, as morph_node does by default.

    Samples are numbered through all states.
    """

    def __init__(self, request: Request, noise: str, states: Sequence[State], samples: int) -> None:
        settings = pick(EstimatorSettings, parameter_values("morph_node"))
        self._estimator = MorphEstimator.load(request.model, request.weights or "", settings)
        self._estimator.warm_up()
        self._seed, self._noise = request.seed, noise
        self._states, self._samples = states, samples

    def __call__(self, index: int) -> Outcome:
        """Return what the estimate of a sample is worth."""
        number, sample = divmod(index, self._samples)
        return _outcome(self._estimator, self._states[number], self._noise, self._seed, sample)


def moved_experiment(
    request: Request, states: Sequence[State], samples: int
) -> SharedExperiment[Outcome]:
    """Return what tells the worth of estimates of objects with a moved joint.

    Raises
    ------
    MethodError
        If a joint is none whose position is estimated, or the noise is of rooms.
    """
    model = KinematicModel.load(request.model)
    known = {joint.name: joint for joint in model.states}
    for moved in states:
        if moved.joint not in known:
            names = ", ".join(known) or "none"
            raise MethodError(
                f"'{moved.joint}' is no joint of '{model.name}' whose position is estimated "
                f"(those are: {names})"
            )
    noise = request.noise or "none"
    if noise not in NOISES:
        raise MethodError(f"noise must be {', '.join(NOISES)}, found '{noise}'")

    def conclude(found: list[Outcome]) -> tuple[str, Any]:
        outcomes = [outcome._asdict() for outcome in found]
        result = {
            "model": model.name,
            "samples": samples,
            "seed": request.seed,
            "noise": noise,
            "states": {
                f"{moved.joint} = {moved.position:g}": outcomes[i * samples : (i + 1) * samples]
                for i, moved in enumerate(states)
            },
        }
        return moved_report(result), result

    return SharedExperiment(
        title=f"evaluate {model.name} ({noise})",
        unit="samples",
        items=len(states) * samples,
        kind=Outcome,
        make=partial(MovedMeasurement, request, noise, states, samples),
        conclude=conclude,
        worthwhile=WORTHWHILE,
    )


def moved_report(result: dict[str, Any]) -> str:
    """Return the table of `moved_experiment`: errors are those of estimates that are OK."""
    rows: list[Sequence[str]] = [HEADINGS]
    for name, outcomes in result["states"].items():
        ok = [outcome for outcome in outcomes if outcome["ok"]]
        off, stated, others = ([each[key] for each in ok] for key in ("off", "stated", "others"))
        rows.append(
            [
                name,
                f"{len(ok)} of {len(outcomes)}",
                f"{sum(outcome['covered'] for outcome in ok)} of {len(ok)}",
                text(median(off) if ok else None, THOUSAND, 2),
                text(max(off, default=None), THOUSAND, 2),
                text(median(stated) if ok else None, THOUSAND, 2),
                text(max(others, default=None), THOUSAND, 2),
                text(median(outcome["seconds"] for outcome in outcomes), THOUSAND, 0),
            ]
        )
    title = (
        f"{result['model']}: {result['samples']} samples of each state, seed {result['seed']}, "
        f"noise {result['noise']}; mm or mrad"
    )
    return f"{title}\n{columns(rows)}"


def _outcome(estimator: MorphEstimator, moved: State, noise: str, seed: int, index: int) -> Outcome:
    """Estimate a random object with its joint moved."""
    model = estimator.model
    generator = np.random.default_rng(np.random.SeedSequence((seed, index), spawn_key=EVALUATION))
    truth = model.sample(generator, 1)[0]
    observation = observe(
        model, truth, model.camera, noise, generator, {moved.joint: moved.position}
    )
    started = time.perf_counter()
    estimate = estimator.estimate(observation)
    seconds = time.perf_counter() - started
    values = np.concatenate([estimate.theta, estimate.gamma])
    joint = next((each for each in estimate.joints if each.name == moved.joint), None)
    off = abs(joint.value - moved.position) if joint else np.nan
    stated = joint.deviation if joint else np.nan
    inside = is_covered(model, values, estimate.covariance, truth, CONFIDENCE)
    return Outcome(
        ok=estimate.status is Status.OK,
        covered=inside and off**2 <= chi2_quantile(CONFIDENCE, 1) * stated**2,
        off=off,
        stated=stated,
        others=float(absolute_errors(model, values, truth).max()),
        seconds=seconds,
    )
