"""Errors of predicted morphing parameters, as the paper measures them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.model.observation import Observation
from kmn_perception.network.morph import predictions
from kmn_perception.network.morph_network import MorphNetwork


def absolute_errors(
    model: KinematicModel, values: NDArray[np.float64], truth: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return |values - truth| (..., n + m), of the equivalent parameters nearest to the truth."""
    return np.abs(model.nearest_equivalent(values, truth) - truth)


def values_by_step(
    network: MorphNetwork, observations: Sequence[Observation]
) -> Iterator[NDArray[np.float64]]:
    """Yield the estimates (B, n + m) after 0, 1, ... predictions, as many as the network makes."""
    yield network.start(observations)
    for state in predictions(network, observations):
        yield state.values


def errors_by_step(
    network: MorphNetwork,
    observations: Sequence[Observation],
    truth: NDArray[np.float64],
    steps: int,
) -> NDArray[np.float64]:
    """Return the absolute errors (S, B, n + m) after 0, 1, ..., up to ``steps`` predictions."""
    values = np.stack(list(islice(values_by_step(network, observations), steps + 1)))
    return absolute_errors(network.model, values, truth)
