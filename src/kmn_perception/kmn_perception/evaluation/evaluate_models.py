"""Measure how often the right one of several models is told of an object, and none of a thing."""

from __future__ import annotations

import argparse
import os
from collections import Counter
from collections.abc import Iterator, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from kmn_perception.command_line.arguments import whole_number
from kmn_perception.command_line.columns import NONE, columns
from kmn_perception.configuration import resources
from kmn_perception.configuration.hashes import short_hash
from kmn_perception.configuration.node_parameters import parameter_values, pick
from kmn_perception.estimate import Status
from kmn_perception.estimator import EstimatorSettings, MorphEstimator
from kmn_perception.evaluation.things import ThingSettings, draw_thing, kinds_of
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.model.observation import Observation
from kmn_perception.model.rendering import depth_to_cloud, render
from kmn_perception.model.sensor_noise import NOISES, add_noise
from kmn_perception.model_choice import ModelChoice
from kmn_perception.sharing.experiment import ExperimentCommand, SharedExperiment
from kmn_perception.training.samples import EVALUATION, sample

WORTHWHILE = 20  # samples of a process; for fewer its start, some seconds, does not pay
THINGS = (2,)  # spawn key that sets their random numbers apart from those of objects


class Told(NamedTuple):
    """What was seen, and what was told of it.

    Attributes
    ----------
    seen
        Name of its model, or kind of a thing of no model.
    is_object
        Whether it is of one of the models.
    model, status
        Of the estimate.
    """

    seen: str
    is_object: bool
    model: str
    status: Status


class ModelMeasurement:
    """Shows objects of several models, and things of none, to the choice among the models.

    Each is seen by the canonical camera of its model, or of that in the place of which it is.

    Parameters
    ----------
    objects
        Number of objects; the samples after these are things, and as many.
    """

    def __init__(self, models: Sequence[str], seed: int, noise: str, objects: int) -> None:
        settings = pick(EstimatorSettings, parameter_values("morph_node"))
        estimators = [MorphEstimator.load(model, "", settings) for model in models]
        self.choice = ModelChoice(estimators)
        for each in self.choice.models:
            each.require_cuboids("the evaluation of several models")
        self._things = ThingSettings.load()
        self._seed, self._noise, self._objects = seed, noise, objects

    def __call__(self, index: int) -> Told:
        """Return what is told of a sample."""
        is_object, number = index < self._objects, index % self._objects
        model = self.choice.models[number % len(self.choice.models)]
        if is_object:
            seen = model.name
            observation, _ = sample(model, self._seed, number, None, self._noise, EVALUATION)
        else:
            kinds = kinds_of(model)
            seen = kinds[number // len(self.choice.models) % len(kinds)]
            observation = self._thing(seen, number)
        estimate = self.choice.estimate(observation)
        return Told(seen, is_object, estimate.model.name, estimate.status)

    def _thing(self, kind: str, number: int) -> Observation:
        """Return what a camera sees of a thing."""
        model = self.choice.models[number % len(self.choice.models)]
        seed = np.random.SeedSequence((self._seed, number), spawn_key=THINGS)
        generator = np.random.default_rng(seed)
        while True:
            cubes = draw_thing(kind, model, self._things, generator)
            depth = add_noise(render(cubes, model.camera), self._noise, generator)
            cloud = depth_to_cloud(depth, model.camera)
            if len(cloud) >= self.choice.settings.min_points:
                return Observation(cloud, model.camera)


def table(told: Sequence[Told], models: Sequence[str]) -> str:
    """Return how often what was told of what, and what that means."""
    rows = [["seen", "number", *(f"OK: {name}" for name in models), "ambiguous", "other", "best"]]
    for seen in dict.fromkeys(each.seen for each in told):
        some = [each for each in told if each.seen == seen]
        ok = Counter(each.model for each in some if each.status is Status.OK)
        ambiguous = sum(each.status is Status.AMBIGUOUS for each in some)
        rest = len(some) - ok.total() - ambiguous
        best = sum(each.model == seen for each in some)
        counts = [len(some), *(ok[name] for name in models), ambiguous, rest]
        rows.append([seen, *map(str, counts), str(best) if some[0].is_object else NONE])
    return "\n\n".join([columns(rows), "\n".join(_verdicts(told))])


def _verdicts(told: Sequence[Told]) -> Iterator[str]:
    objects = [each for each in told if each.is_object]
    ok = [each for each in objects if each.status is Status.OK]
    right = sum(each.model == each.seen for each in ok)
    best = sum(each.model == each.seen for each in objects)
    things = [each for each in told if not each.is_object]
    wrong = sum(each.status is Status.OK for each in things)
    yield f"objects explained best by their own model: {best} of {len(objects)}"
    yield f"objects that are OK: {len(ok)} of {len(objects)}, of these as their own model: {right}"
    yield f"things of no model that are OK: {wrong} of {len(things)}"


def parser() -> argparse.ArgumentParser:
    """Return the parser of what is to be evaluated."""
    parser = argparse.ArgumentParser(prog="evaluate_models", description=__doc__)
    parser.add_argument("--models", required=True, help="names or YAML files, separated by commas")
    parser.add_argument(
        "--samples", type=whole_number(1), default=200,
        help="objects, by turns of each model, and as many things of none (default 200)",
    )  # fmt: skip
    parser.add_argument("--seed", type=whole_number(0), default=0, help="of samples (default 0)")
    parser.add_argument("--noise", choices=NOISES, default="kinect", help="default kinect")
    return parser


def prepare(options: argparse.Namespace) -> SharedExperiment[Told]:
    """Return the experiment that the options tell."""
    models = [name.strip() for name in options.models.split(",")]
    names = [KinematicModel.load(model).name for model in models]
    files = [resources.find("config/models", model) for model in models]

    def conclude(told: list[Told]) -> tuple[str, Any]:
        counts = Counter((each.seen, each.model, each.status.name) for each in told)
        keys = ("seen", "best", "status", "number")
        return table(told, names), {
            **{name: getattr(options, name) for name in ("models", "samples", "seed", "noise")},
            "told": [dict(zip(keys, (*of, n), strict=True)) for of, n in sorted(counts.items())],
        }

    return SharedExperiment(
        title="evaluate_models",
        unit="samples",
        items=2 * options.samples,
        kind=Told,
        make=partial(ModelMeasurement, models, options.seed, options.noise, options.samples),
        conclude=conclude,
        worthwhile=WORTHWHILE,
        depends_on={"model files": short_hash(*files)},
    )


COMMAND = ExperimentCommand(
    package="kmn_perception",
    name="evaluate_models",
    parser=parser,
    prepare=prepare,
    expected=(ValueError,),
    jobs=os.cpu_count() or 1,
)


def main(argv: Sequence[str] | None = None) -> None:
    """Run the executable ``evaluate_models``."""
    COMMAND.start(argv)
