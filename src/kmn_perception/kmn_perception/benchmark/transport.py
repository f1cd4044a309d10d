"""Clouds through a real topic from one process to another."""

from __future__ import annotations

import multiprocessing
import os
import signal
import time
from collections.abc import Mapping
from typing import Any

import numpy as np
import rclpy
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.time import Time
from sensor_msgs.msg import PointCloud2
from tqdm import tqdm

from kmn_perception.benchmark.scene import full_cloud
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.ros.camera_subscriptions import DEPTH, CameraSubscriptions
from kmn_perception.ros.message_gaps import MessageGaps
from kmn_perception.ros.morph_node_parameters import MorphNodeSettings
from kmn_perception.ros.program import ros_session

TOPIC = "benchmark/points"  # not `points`: nodes that run beside are left alone
PERIOD = 1.0 / 30.0  # seconds
PROFILE = "FASTRTPS_DEFAULT_PROFILES_FILE"
SENDERS = ("with_our_profile", "foreign")  # one that was started without it
DISCOVERY_TIMEOUT = 20.0  # seconds
DISCOVERY_MARGIN = 2.0  # seconds for both sides to know each other, and how reliable they are
FLUSH = 2.0  # seconds for the last clouds to arrive


def measure(node: Node, settings: MorphNodeSettings, frames: int, sender: str) -> dict[str, float]:
    """Receive, as morph_node does, the clouds that another process publishes at 30 Hz.

    Parameters
    ----------
    sender
        One of ``SENDERS``.

    Returns
    -------
    transport
        ``sent`` and ``received`` clouds, those ``lost`` between received ones by their numbers, and
        ``median_ms`` from before `publish` to the callback.

    Raises
    ------
    ChildProcessError
        If the other process failed.
    """
    milliseconds: list[float] = []
    gaps = MessageGaps()
    with tqdm(total=frames, desc=f"{sender} transport", unit=" clouds", mininterval=1.0) as bar:

        def receive(cloud: PointCloud2, info: Mapping[str, Any]) -> None:
            gaps.add(TOPIC, info)
            age = node.get_clock().now() - Time.from_msg(cloud.header.stamp)
            milliseconds.append(age.nanoseconds * 1e-6)
            bar.update()

        subscriptions = CameraSubscriptions(node, ReliabilityPolicy[settings.reliability.upper()])
        subscription = subscriptions.subscribe(PointCloud2, TOPIC, receive)
        publisher = multiprocessing.get_context("spawn").Process(
            target=publish, args=(settings.model, frames, sender), daemon=True
        )
        # The child inherits that it ignores Ctrl-C: this process ends both.
        on_interrupt = signal.signal(signal.SIGINT, signal.SIG_IGN)
        publisher.start()
        signal.signal(signal.SIGINT, on_interrupt)
        try:
            while publisher.is_alive():
                rclpy.spin_once(node, timeout_sec=PERIOD)
        finally:
            publisher.kill()
            publisher.join()
            subscriptions.end(subscription)
    if publisher.exitcode != 0:
        raise ChildProcessError(f"the publishing process ended with {publisher.exitcode}")
    return {
        "sent": frames,
        "received": len(milliseconds),
        "lost": gaps.lost,
        "median_ms": float(np.median(milliseconds)) if milliseconds else float("nan"),
    }


def publish(model: str, frames: int, sender: str) -> None:
    """Publish clouds at 30 Hz as soon as somebody listens; runs in a process of its own."""
    if sender == "foreign":
        os.environ.pop(PROFILE, None)
    cloud = full_cloud(KinematicModel.load(model))
    with ros_session("benchmark"):
        _publish(Node("benchmark_publisher"), cloud, frames)


def _publish(node: Node, cloud: PointCloud2, frames: int) -> None:
    publisher = node.create_publisher(PointCloud2, TOPIC, QoSProfile(depth=DEPTH))
    deadline = time.monotonic() + DISCOVERY_TIMEOUT
    while not publisher.get_subscription_count() and time.monotonic() < deadline:
        time.sleep(PERIOD)
    time.sleep(DISCOVERY_MARGIN)
    due = time.monotonic()
    for _ in range(frames):
        time.sleep(max(0.0, due - time.monotonic()))
        cloud.header.stamp = node.get_clock().now().to_msg()
        publisher.publish(cloud)
        due += PERIOD
    time.sleep(FLUSH)
