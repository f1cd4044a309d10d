"""Milliseconds of each stage between a cloud and its morphing parameters."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable

import numpy as np
from sensor_msgs.msg import PointCloud2
from tqdm import tqdm

from kmn_perception.estimator import MorphEstimator
from kmn_perception.network.morph import predict
from kmn_perception.pipeline import MorphPipeline
from kmn_perception.refinement import refine
from kmn_perception.ros.messages import (
    markers_from_estimates,
    parameters_from_estimate,
    view_from_cloud,
)
from kmn_perception.ros.morph_node_parameters import MorphNodeSettings
from kmn_perception.scene.depth_view import DepthView

STEPS = 5  # predictions, as in the paper, or as many as the network makes
Stage = Callable[[], object]


def chain(
    estimator: MorphEstimator, settings: MorphNodeSettings, cloud: PointCloud2
) -> tuple[dict[str, Stage], int]:
    """Return the stages that a cloud goes through, and the number of the object's points.

    Raises
    ------
    ValueError
        If no object is found in the cloud.
    """
    model, network = estimator.model, estimator.network
    pipeline = MorphPipeline(estimator, settings.pipeline)
    # Without a tolerance all steps are made, as for an object that converges late.
    estimator.settings = dataclasses.replace(settings.estimator, iterations=STEPS, tolerance=0.0)

    def message_to_view() -> DepthView:
        return view_from_cloud(cloud, settings.max_range, settings.world_frame)

    def callback() -> None:
        estimate = pipeline.estimate(message_to_view())
        parameters_from_estimate(estimate, cloud.header)
        markers_from_estimates([(estimate, pipeline.bodies(estimate))], cloud.header)

    view = message_to_view()
    views = pipeline.observe(view, 1)
    if not views:
        raise ValueError(f"the node's parameters leave nothing of a '{model.name}'")
    observation = views[0].observation
    seen, first = [observation], network.start([observation])
    images = network.render_anew(0, seen, first)
    predicted, _ = predict(network, seen, STEPS)
    return {
        "message_to_view": message_to_view,
        "background_removal": lambda: pipeline.observe(view, 1),
        "splat": lambda: network.render_anew(0, seen, first),
        "network": lambda: network.predict(0, images),
        "predictions": lambda: predict(network, seen, STEPS),
        "refinement": lambda: refine(model, observation, predicted.values[0], estimator.refinement),
        "refined_estimate": lambda: estimator.estimate(observation),
        "callback": callback,
    }, len(observation.points)


def measure(chain: dict[str, Stage], repetitions: int) -> dict[str, dict[str, float]]:
    """Return median and 95th percentile of each stage in milliseconds.

    The stages take turns, so that a disturbance does not hit one of them alone.
    """
    milliseconds: dict[str, list[float]] = {name: [] for name in chain}
    for stage in chain.values():
        stage()  # the first time loads and compiles
    for _ in tqdm(range(repetitions), desc="stages", unit=" rounds", mininterval=1.0):
        for name, stage in chain.items():
            started = time.perf_counter()
            stage()
            milliseconds[name].append(1e3 * (time.perf_counter() - started))
    return {
        name: {"median_ms": float(np.median(times)), "p95_ms": float(np.percentile(times, 95))}
        for name, times in milliseconds.items()
    }
