"""Errors of predicted morphing parameters, as the paper measures them."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from kmn_perception.kinematic_model import KinematicModel
from kmn_perception.morph import Clouds, predictions, start
from kmn_perception.network import MorphNetwork


def absolute_errors(
    model: KinematicModel, values: NDArray[np.float64], truth: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return |values - truth| (..., n + m), of the equivalent parameters nearest to the truth."""
    return np.abs(model.nearest_equivalent(values, truth) - truth)


def values_by_step(
    model: KinematicModel, network: MorphNetwork, clouds: Clouds
) -> Iterator[NDArray[np.float64]]:
    """Yield the estimates (B, n + m) after 0, 1, ... predictions, without end.

    Before the first prediction it is the start of Algorithm 1 with gamma_0 = 0.
    """
    theta = start(model, clouds)
    yield np.concatenate((theta, np.zeros((len(theta), len(model.gamma)))), axis=1)
    for state in predictions(model, network, clouds, theta):
        yield state.values


def errors_by_step(
    model: KinematicModel,
    network: MorphNetwork,
    clouds: Clouds,
    truth: NDArray[np.float64],
    steps: int,
) -> NDArray[np.float64]:
    """Return the absolute errors (steps + 1, B, n + m) after 0, 1, ..., ``steps`` predictions."""
    values = np.stack(list(islice(values_by_step(model, network, clouds), steps + 1)))
    return absolute_errors(model, values, truth)
