"""The shipped transport profile carries full clouds from one process to another without loss."""

import subprocess
import sys
import time
from array import array
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
import rclpy
from domain_coordinator import domain_id
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import PointCloud2

CLOUDS = 30
CLOUD_BYTES = 640 * 480 * 16
PERIOD_S = 0.1
TIMEOUT_S = 60


@contextmanager
def running_node(name: str, domain: int) -> Iterator[tuple[Node, SingleThreadedExecutor]]:
    """Give a node with its own context and executor."""
    context = Context()
    rclpy.init(context=context, domain_id=domain)
    node = Node(name, context=context)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)
    try:
        yield node, executor
    finally:
        executor.shutdown()
        node.destroy_node()
        rclpy.shutdown(context=context)


def publish_clouds(domain: int) -> None:
    """Publish numbered clouds at 10 Hz once there is a subscriber; run in the other process."""
    with running_node("cloud_publisher", domain) as (node, _):
        publisher = node.create_publisher(PointCloud2, "points", QoSProfile(depth=5))
        cloud = PointCloud2(height=480, width=640, point_step=16, row_step=640 * 16)
        cloud.data = array("B", bytes(CLOUD_BYTES))
        while publisher.get_subscription_count() == 0:
            time.sleep(PERIOD_S)
        for number in range(CLOUDS):
            time.sleep(PERIOD_S)
            cloud.header.frame_id = str(number)
            publisher.publish(cloud)
        time.sleep(1.0)


@pytest.mark.parametrize("reliability", ["BEST_EFFORT", "RELIABLE"])
def test_no_cloud_is_lost_between_two_processes(reliability: str) -> None:
    received: list[tuple[str, int]] = []

    def note(cloud: PointCloud2) -> None:
        received.append((cloud.header.frame_id, len(cloud.data)))

    qos = QoSProfile(depth=5, reliability=ReliabilityPolicy[reliability])
    with domain_id() as domain, running_node("cloud_subscriber", domain) as (node, executor):
        node.create_subscription(PointCloud2, "points", note, qos)
        publisher = subprocess.Popen([sys.executable, str(Path(__file__)), str(domain)])
        deadline = time.monotonic() + TIMEOUT_S
        while publisher.poll() is None and time.monotonic() < deadline:
            executor.spin_once(timeout_sec=PERIOD_S)
        publisher.kill()
    assert received == [(str(number), CLOUD_BYTES) for number in range(CLOUDS)]


if __name__ == "__main__":
    publish_clouds(int(sys.argv[1]))
