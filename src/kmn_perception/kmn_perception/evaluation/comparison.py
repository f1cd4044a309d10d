"""What is measured on each sample, by each of the processes that measure."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kmn_perception.evaluation.coverage import is_covered
from kmn_perception.evaluation.information_limit import best_estimate
from kmn_perception.evaluation.methods import (
    METHODS,
    PEERS,
    Method,
    MethodError,
    MethodEstimate,
    choose,
)
from kmn_perception.evaluation.networks import Networks, load_networks
from kmn_perception.evaluation.settings import EvaluationSettings
from kmn_perception.evaluation.visible_fraction import visible_fraction
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.model.observation import Observation
from kmn_perception.model.sensor_noise import NOISES
from kmn_perception.network.errors import absolute_errors
from kmn_perception.network.weights import Weights
from kmn_perception.training.samples import EVALUATION, sample
from kmn_perception.training.settings import SensorSettings

LIMIT = "information_limit"
NAMES = (*METHODS, LIMIT)
CONFIDENCE = 0.95  # of the ellipsoids


@dataclass(frozen=True)
class Request:
    """What to evaluate.

    Attributes
    ----------
    model
        Name or YAML file.
    seed, noise
        Of the samples; without noise they are seen as in training.
    methods
        Names; ``None``: all for which the model has weights, but for the peers.
    peers
        With these as well, on fewer samples, where no methods are named.
    lenient
        Leave out named methods for which the model has no weights.
    weights, paper_weights
        Files for our network and for the paper's; ``None``: the shipped ones.
    """

    model: str
    seed: int
    noise: str | None = None
    methods: tuple[str, ...] | None = None
    peers: bool = False
    lenient: bool = False
    weights: str | None = None
    paper_weights: str | None = None


class Measurement(NamedTuple):
    """How well a method did on a sample.

    ``errors`` (S, n + m) after 0, 1, ... steps, ``seconds`` to the step that counts, and whether
    the truth was ``covered`` by the estimate's ellipsoid, if it has one.
    """

    errors: NDArray[np.float64]
    seconds: float
    covered: bool | None


class Comparison:
    """Compares methods on samples that never trained.

    Attributes
    ----------
    counted
        By method, the number of the step whose estimate is the result.
    left_out
        By method, why it is not compared.

    Raises
    ------
    MethodError
        If a method that was named lacks something.
    """

    def __init__(self, request: Request, settings: EvaluationSettings) -> None:
        self.model = KinematicModel.load(request.model)
        self.networks = load_networks(self.model, request.weights, request.paper_weights)
        usual = NAMES if request.peers else [name for name in NAMES if name not in PEERS]
        names = usual if request.methods is None else request.methods
        if request.noise not in (None, *NOISES):
            raise MethodError(
                f"'{self.model.name}' is seen with the noise {', '.join(NOISES)}, "
                f"found '{request.noise}'"
            )
        self._methods, self.left_out = choose(
            [name for name in names if name != LIMIT], self.model, self.networks, settings
        )
        if LIMIT in names and any(body.is_cylinder for body in self.model.bodies):
            self.left_out[LIMIT] = "it is known of cuboids only"
        if self.left_out and request.methods is not None and not request.lenient:
            raise MethodError("; ".join(f"{name}: {why}" for name, why in self.left_out.items()))
        self._limit = LIMIT in names and LIMIT not in self.left_out
        self._request, self._settings = request, settings
        self._sensor, self.noise = sensor_of(self.networks, request.noise)
        self.counted = {name: method.counted for name, method in self._methods.items()}
        if self._limit:
            self.counted[LIMIT] = 0

    def sample(self, index: int) -> tuple[Observation, NDArray[np.float64]]:
        """Return a sample's observation and truth (n + m,)."""
        seed = self._request.seed
        return sample(self.model, seed, index, self._sensor, self.noise, EVALUATION)

    def __call__(self, index: int) -> tuple[float, dict[str, Measurement]]:
        """Return a sample's visible fraction, and how well each method did on it."""
        observation, truth = self.sample(index)
        cubes = self.model.unit_cubes(*self.model.split(truth))
        methods = dict(self._methods)
        if self._request.methods is None and index >= self._settings.peer_samples:
            methods = {name: method for name, method in methods.items() if name not in PEERS}
        if self._limit:
            methods[LIMIT] = Method(lambda seen: self._best(seen, truth), counted=0)
        return visible_fraction(cubes, observation.camera, self.model.cylinder_axes), {
            name: self._measure(method, observation, truth) for name, method in methods.items()
        }

    def estimates(self, name: str, observation: Observation) -> list[NDArray[np.float64]]:
        """Return a method's estimates (n + m,) after 0, 1, ... steps, up to the one that counts."""
        estimates = self._methods[name].estimates(observation)
        return [estimate.values for estimate in islice(estimates, self.counted[name] + 1)]

    def _best(
        self, observation: Observation, truth: NDArray[np.float64]
    ) -> Iterator[MethodEstimate]:
        yield MethodEstimate(best_estimate(self.model, observation.camera, truth))

    def _measure(
        self, method: Method, observation: Observation, truth: NDArray[np.float64]
    ) -> Measurement:
        started = time.perf_counter()
        estimates = method.estimates(observation)
        steps = list(islice(estimates, method.counted + 1))
        seconds = time.perf_counter() - started
        result = steps[-1]
        steps += islice(estimates, self._settings.shown_steps - method.counted)
        covered = None
        if result.covariance is not None:
            covered = is_covered(self.model, result.values, result.covariance, truth, CONFIDENCE)
        values = np.stack([estimate.values for estimate in steps])
        return Measurement(absolute_errors(self.model, values, truth), seconds, covered)


def sensor_of(networks: Networks, noise: str | None) -> tuple[SensorSettings | None, str]:
    """Return the sensor from which samples are seen, and its noise.

    It is the one that the paper's network was trained for, else ours, with the noise that is given.
    Where these were trained for the canonical camera, or where there are none, it is that camera.
    Its pose is known here: no method could tell the error of its calibration.
    """
    loaded = [weights for weights in networks[:2] if isinstance(weights, Weights)]
    trained = loaded[0].metadata.get("training", {}).get("sensor") if loaded else None
    if trained is None:
        return None, noise or "none"
    known = {"noise": noise or trained["noise"], "pose_error": (0.0, 0.0)}
    sensor = SensorSettings(**{"holes": 0.0, **trained, **known})
    return sensor, sensor.noise
