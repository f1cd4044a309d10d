"""Puts scenes before a running sim_node and takes what a running morph_node makes of them."""

from __future__ import annotations

import os
import tempfile
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import rclpy
from numpy.typing import NDArray
from rcl_interfaces.srv import SetParametersAtomically
from rclpy.node import Node

from kmn_msgs.msg import MorphingParameters
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.ros.node_process import (
    NodeProcess,
    ProcessClient,
    namespace_arguments,
    parameter_arguments,
)
from kmn_perception.ros.stamps import seconds
from kmn_sim.checks.settings import PerceptionCheckSettings


class SceneEstimate(NamedTuple):
    """True and estimated morphing parameters (n + m,) of a scene, and how it went.

    Attributes
    ----------
    status, reason
        Of morph_node's message.
    latency
        Seconds from the exposure to the reception of the estimate.
    """

    truth: NDArray[np.float64]
    estimate: NDArray[np.float64]
    status: int
    reason: str
    latency: float


class SceneClient:
    """A client of both nodes.

    Parameters
    ----------
    node
        In the namespace of the two.
    processes
        The two, which are watched.
    settings
        How long to wait.
    """

    def __init__(
        self, node: Node, processes: list[NodeProcess], settings: PerceptionCheckSettings
    ) -> None:
        self._timeout, self._creep = settings.answer_timeout, settings.creep
        self._client = ProcessClient(node, processes)
        self._estimates: list[tuple[MorphingParameters, float]] = []
        self._truths: list[MorphingParameters] = []
        node.create_subscription(MorphingParameters, "morphing_parameters", self._keep, 10)
        node.create_subscription(MorphingParameters, "ground_truth", self._truths.append, 10)
        self._setting = node.create_client(
            SetParametersAtomically, "sim_node/set_parameters_atomically"
        )
        self._client.wait(self._setting.service_is_ready, settings.start_timeout, "sim_node")
        self._client.wait(
            lambda: node.count_publishers(f"{node.get_namespace()}/morphed_model"),
            settings.start_timeout,
            "morph_node",
        )

    def show(self, values: NDArray[np.float64], **changes: Any) -> SceneEstimate:
        """Set a scene of morphing parameters (n + m,) and return the estimate of it.

        Parameters
        ----------
        changes
            Of other parameters of sim_node.

        Raises
        ------
        ProcessError
            If a node has ended, or there is no answer.
        """
        scene: dict[str, Any] = {"placement": "given", "values": [float(value) for value in values]}
        scene |= changes
        self._client.set_parameters(self._setting, scene, self._timeout)
        self._truths.clear()
        self._estimates.clear()
        estimate, received = self._client.wait(
            lambda: self._answered(values), self._timeout, "morph_node"
        )
        truth = next(t for t in self._truths if t.header.stamp == estimate.header.stamp)
        return SceneEstimate(
            np.array([*truth.theta, *truth.gamma]),
            np.array([*estimate.theta, *estimate.gamma]),
            int(estimate.status),
            estimate.reason,
            received - seconds(estimate.header.stamp),
        )

    def _keep(self, estimate: MorphingParameters) -> None:
        self._estimates.append((estimate, time.time()))

    def _answered(self, values: NDArray[np.float64]) -> tuple[MorphingParameters, float] | None:
        """Return an estimate of an exposure of the scene; one of the scene before may come late."""
        stamps = [
            truth.header.stamp
            for truth in self._truths
            if np.abs(np.array([*truth.theta, *truth.gamma]) - values).max() < self._creep
        ]
        return next((pair for pair in self._estimates if pair[0].header.stamp in stamps), None)


@contextmanager
def scene_client(
    model: KinematicModel, name: str, parameters: dict[str, Any], settings: PerceptionCheckSettings
) -> Iterator[SceneClient]:
    """Start both nodes in a namespace of their own, for the scenes of a model.

    Parameters
    ----------
    name
        The model's name or file.
    parameters
        Of sim_node, beside model, placement and rate.
    settings
        Of the camera's rate, and how long to wait.
    """
    alone = namespace_arguments(f"/sim_{os.getpid()}")  # whatever else runs is not disturbed
    sim: dict[str, Any] = {
        "model": name,
        "placement": "given",
        "values": [0.0] * len(model.parameters),
    }
    sim |= {**parameters, "camera_rate": settings.camera_rate}
    morph = {"model": name, "reliability": "reliable"}
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        processes = [
            stack.enter_context(
                NodeProcess(
                    package,
                    executable,
                    [*parameter_arguments(parameters), *alone],
                    folder / executable,
                )
            )
            for package, executable, parameters in (
                ("kmn_sim", "sim_node", sim),
                ("kmn_perception", "morph_node", morph),
            )
        ]
        node = rclpy.create_node("scenes", cli_args=["--ros-args", *alone])
        stack.callback(node.destroy_node)
        yield SceneClient(node, processes, settings)
