"""Measure how fast the stages of morph_node and its transport are."""

from __future__ import annotations

import argparse
from typing import Any

from rclpy.node import Node

from kmn_perception.benchmark import callbacks, latency, stages, transport
from kmn_perception.benchmark.scene import full_cloud
from kmn_perception.command_line.arguments import output_file, whole_number, write_json
from kmn_perception.command_line.columns import columns
from kmn_perception.estimator import MorphEstimator
from kmn_perception.network.threads import use_one_thread
from kmn_perception.ros.morph_node_parameters import MorphNodeSettings
from kmn_perception.ros.parameters import declare_parameters
from kmn_perception.ros.program import own_arguments, ros_session


def arguments(argv: list[str]) -> argparse.Namespace:
    """Parse the command line without its ROS arguments."""
    parser = argparse.ArgumentParser(
        prog="benchmark",
        description=__doc__,
        epilog="Parameters are those of morph_node: --ros-args -p model:=NAME ...",
    )
    parser.add_argument(
        "--frames", type=whole_number(1), default=100,
        help="times that each stage runs, and clouds through the topic (default 100)",
    )  # fmt: skip
    parser.add_argument(
        "--profile", choices=callbacks.CASES,
        help="print only in which functions this callback spends its time",
    )  # fmt: skip
    parser.add_argument("--json", type=output_file, help="file to write the result to")
    return parser.parse_args(argv)


def benchmark(node: Node, frames: int) -> dict[str, Any]:
    """Measure all with the parameters of morph_node, as it is written to JSON."""
    settings = MorphNodeSettings.check(declare_parameters(node, "morph_node"))
    use_one_thread()
    estimator = MorphEstimator.load(settings.model, settings.weights, settings.estimator)
    cloud = full_cloud(estimator.model)
    chain, points = stages.chain(estimator, settings, cloud)
    print(
        f"{estimator.model.name}: {points} points of {cloud.width} x {cloud.height}; "
        "torch on 1 thread"
    )
    return {
        "stages": stages.measure(chain, frames),
        "callbacks": callbacks.measure(frames),
        "latency": {latency.CASE: latency.measure(node, frames)},
        "transport": {
            sender: transport.measure(node, settings, frames, sender)
            for sender in transport.SENDERS
        },
    }


def report(result: dict[str, Any]) -> str:
    """Return the tables of a benchmark.

    Parameters
    ----------
    result
        As written to JSON.
    """
    stage_rows = [["stage", "median [ms]", "p95 [ms]"]]
    for name, times in result["stages"].items():
        stage_rows.append([name, f"{times['median_ms']:.2f}", f"{times['p95_ms']:.2f}"])
    callback_rows = [["callback", "median [ms of a core]", "p95 [ms of a core]"]]
    for name, times in result["callbacks"].items():
        callback_rows.append([name, f"{times['median_ms']:.1f}", f"{times['p95_ms']:.1f}"])
    latency_rows = [["latency", "sent", "answered", "median [ms]", "p95 [ms]"]]
    for name, found in result["latency"].items():
        counts = (str(found[key]) for key in ("sent", "answered"))
        latency_rows.append([name, *counts, f"{found['median_ms']:.1f}", f"{found['p95_ms']:.1f}"])
    transport_rows = [["transport", "sent", "received", "lost, by their numbers", "median [ms]"]]
    for sender, found in result["transport"].items():
        counts = (str(found[key]) for key in ("sent", "received", "lost"))
        transport_rows.append([sender, *counts, f"{found['median_ms']:.2f}"])
    return "\n\n".join(map(columns, (stage_rows, callback_rows, latency_rows, transport_rows)))


def main() -> int:
    """Run the executable ``benchmark``."""
    options = arguments(own_arguments())
    if options.profile:
        print(callbacks.profile(options.profile, options.frames))
        return 0
    with ros_session("benchmark"):
        result = benchmark(Node("benchmark"), options.frames)
        print(report(result))
        if options.json:
            write_json(options.json, result)
    return 0
