"""Iterative network predictions (paper, Algorithm 1)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray

from kmn_perception.kinematic_model import KinematicModel
from kmn_perception.network import MorphNetwork
from kmn_perception.observation import point_cloud_to_depth

Clouds = Sequence[NDArray[np.float32]]  # B point clouds (N, 3), world frame, metres


class Prediction(NamedTuple):
    """The state of Algorithm 1 after a step, for B point clouds.

    ``depth`` (B, height, width) shows the clouds morphed by T_theta^-1, ``values`` (B, n + m) is
    (theta, gamma) and ``change`` (B,) the largest entry of the step's own |theta|.
    """

    depth: NDArray[np.float32]
    values: NDArray[np.float64]
    change: NDArray[np.float64]


def predictions(
    model: KinematicModel, network: MorphNetwork, clouds: Clouds, theta: NDArray[np.float64]
) -> Iterator[Prediction]:
    """Yield the state after each step of Algorithm 1, without end.

    Parameters
    ----------
    theta
        (B, n) previous transformation, by default that of ``start``.
    """
    depth = render_anew(model, clouds, theta)
    while True:
        step = network.predict(torch.from_numpy(depth)).numpy()
        theta_bar, gamma = model.split(step)
        # The paper morphs the cloud step by step; morphing the observed cloud by the whole of T
        # is the same, and needs no copy of it.
        theta = model.transformation.concatenate(theta, theta_bar)
        depth = render_anew(model, clouds, theta)
        yield Prediction(
            depth, np.concatenate((theta, gamma), axis=1), np.abs(theta_bar).max(axis=1)
        )


def predict(
    model: KinematicModel,
    network: MorphNetwork,
    clouds: Clouds,
    theta: NDArray[np.float64],
    steps: int,
    tolerance: float = 0.0,
) -> tuple[Prediction, int]:
    """Repeat the prediction N times, or until no step changes theta by more than ``tolerance``.

    Returns
    -------
    prediction, iterations
        The last state, and how many steps it took.
    """
    for iteration, prediction in enumerate(predictions(model, network, clouds, theta), start=1):
        if iteration >= steps or prediction.change.max() <= tolerance:
            break
    return prediction, iteration


def start(model: KinematicModel, clouds: Clouds) -> NDArray[np.float64]:
    """Return the previous transformation (B, n) from which Algorithm 1 starts.

    The prototype's theta_0 = 0, or, if the model says so, the translation to the clouds'
    horizontal centres.
    """
    theta = np.zeros((len(clouds), len(model.theta)))
    if model.start == "centroid":
        centres = np.stack([cloud.mean(axis=0, dtype=np.float64) for cloud in clouds])
        for column, (kind, axis) in enumerate(model.transformation.kinds):
            if kind == "translation" and axis in "xy":
                theta[:, column] = centres[:, "xy".index(axis)]
    return theta


def render_anew(
    model: KinematicModel, clouds: Clouds, theta: NDArray[np.float64]
) -> NDArray[np.float32]:
    """Return the depth images (B, height, width) of the clouds morphed by T_theta^-1 (Eq. 5)."""
    inverse = model.transformation.inverse(theta)
    return np.stack(
        [
            point_cloud_to_depth(model, cloud, matrix)
            for cloud, matrix in zip(clouds, inverse, strict=True)
        ]
    )
