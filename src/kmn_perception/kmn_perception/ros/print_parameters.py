"""Print what morph_node publishes, an object a line: parameters with their standard deviations."""

from __future__ import annotations

import argparse
import math
from contextlib import suppress

import numpy as np
import rclpy
from rclpy.node import Node

from kmn_msgs.msg import MorphingParameters
from kmn_perception.estimate import status_name
from kmn_perception.ros.program import own_arguments, ros_session

QUEUE_DEPTH = 100
TURN = 0.2  # seconds; an interrupt waits for the end of one


def describe(message: MorphingParameters) -> str:
    """Return model, number, status and reason, and the parameters in the model's units."""
    names = [*message.theta_names, *message.gamma_names, *message.joint_names]
    values = [*message.theta, *message.gamma, *message.joint_positions]
    count = len(message.theta) + len(message.gamma)
    variances = np.asarray(message.covariance)[:: count + 1]
    deviations = [*np.sqrt(np.maximum(variances, 0.0)), *message.joint_deviations]
    texts = [
        f"{name} {value:.4f} ± {deviation:.4f}"
        for name, value, deviation in zip(names, values, deviations, strict=False)
        if math.isfinite(value)
    ]
    head = f"{message.model} {message.id}: {status_name(message.status)}"
    return "  ".join(filter(None, [head, message.reason, *texts]))


def main() -> int:
    """Run the executable ``print_parameters``."""
    parser = argparse.ArgumentParser(prog="print_parameters", description=__doc__)
    parser.parse_args(own_arguments())
    with ros_session("print_parameters"), suppress(KeyboardInterrupt):
        node = Node("print_parameters")
        node.create_subscription(
            MorphingParameters,
            "morphing_parameters",
            lambda message: print(describe(message), flush=True),
            QUEUE_DEPTH,
        )
        while True:
            rclpy.spin_once(node, timeout_sec=TURN)
    return 0
