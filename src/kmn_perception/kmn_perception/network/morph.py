"""Iterative network predictions (paper, Algorithm 1)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import count
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kmn_perception.model.observation import Observation
from kmn_perception.network.morph_network import MorphNetwork


class Prediction(NamedTuple):
    """The state of Algorithm 1 after a step, for B observations.

    ``values`` (B, n + m) is (theta, gamma) and ``change`` (B,) the largest entry of the step's own
    |theta|.
    """

    values: NDArray[np.float64]
    change: NDArray[np.float64]


def predictions(network: MorphNetwork, observations: Sequence[Observation]) -> Iterator[Prediction]:
    """Yield the state after each step of Algorithm 1, for as many steps as the network has."""
    values = network.start(observations)
    for step in count() if network.steps is None else range(network.steps):
        depth = network.render_anew(step, observations, values)  # of the points T^-1 P
        predicted = network.predict(step, depth)  # (theta_bar, gamma) = f(depth)
        values = network.concatenate(values, predicted)  # T = T T_bar
        theta_bar, _ = network.model.split(predicted)
        yield Prediction(values, np.abs(theta_bar).max(axis=1))


def predict(
    network: MorphNetwork,
    observations: Sequence[Observation],
    steps: int,
    tolerance: float = 0.0,
) -> tuple[Prediction, int]:
    """Repeat the prediction N times, or until a step changes theta by no more than ``tolerance``.

    A network with a stage for each prediction makes them all: where theta is right, gamma may
    still be wrong.

    Returns
    -------
    prediction, iterations
        The last state, and how many steps it took.
    """
    for iteration, prediction in enumerate(predictions(network, observations), start=1):
        settled = network.steps is None and prediction.change.max() <= tolerance
        if settled or iteration >= steps:
            break
    return prediction, iteration
