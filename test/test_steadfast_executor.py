"""What ROS itself cannot read ends no node; an error of the node's own does."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import pytest
from rcl_interfaces.msg import Parameter, ParameterValue
from rcl_interfaces.srv import SetParameters
from rclpy.clock import Clock as WallClock
from rclpy.node import Node
from rclpy.parameter import Parameter as NodeParameter
from rclpy.serialization import serialize_message
from rclpy.task import Future
from rosgraph_msgs.msg import Clock
from std_msgs.msg import String

from graph import Graph
from kmn_perception.ros.steadfast_executor import SteadfastExecutor


@pytest.fixture
def node(graph: Graph) -> Iterator[Node]:
    made = Node(
        "hardy",
        context=graph.context,
        parameter_overrides=[NodeParameter("use_sim_time", value=True)],
    )
    yield made
    made.destroy_node()


@pytest.fixture
def running(node: Node) -> Iterator[Any]:
    """Execute the node in a thread, and return what that will have come to."""
    executor, done = SteadfastExecutor(node), Future()
    with ThreadPoolExecutor(1) as thread:
        yield thread.submit(executor.spin_until_future_complete, done)
        done.set_result(None)
        executor.wake()
    executor.shutdown()


def test_what_ros_cannot_read_is_passed_over(graph: Graph, node: Node, running: Any) -> None:
    heard: list[str] = []
    keep: Callable[[Any], None] = lambda message: heard.append(message.data)  # noqa: E731
    node.create_subscription(String, "texts", keep, 10)
    peer = graph.start(lambda **options: Node("peer", **options))
    texts, clock = (
        peer.create_publisher(String, "texts", 10),
        peer.create_publisher(Clock, "/clock", 10),
    )
    setting = peer.create_client(SetParameters, "hardy/set_parameters")
    graph.wait_for(texts.get_subscription_count)
    graph.wait_for(clock.get_subscription_count)
    setting.wait_for_service()
    not_utf8 = serialize_message(String(data="abcdefgh")).replace(b"cd", b"\xff\xfe")
    negative = Clock()
    negative.clock.sec = -1
    strange = Parameter(name="use_sim_time", value=ParameterValue(type=127))
    for _ in range(3):
        texts.publish(not_utf8)
        clock.publish(negative)
        setting.call_async(SetParameters.Request(parameters=[strange]))
    texts.publish(String(data="valid"))
    graph.wait_for(lambda: "valid" in heard)
    valid = Parameter(name="use_sim_time", value=ParameterValue(type=1, bool_value=True))
    answer = setting.call_async(SetParameters.Request(parameters=[valid]))
    graph.wait_for(answer.done)
    assert answer.result().results[0].successful
    assert not running.done()


def test_an_error_of_a_callback_is_raised(graph: Graph, node: Node, running: Any) -> None:
    called = threading.Event()

    def fail() -> None:
        called.set()
        load_what_is_not_there()

    node.create_timer(0.01, fail, clock=WallClock())
    assert called.wait(30.0)
    with pytest.raises(FileNotFoundError):
        running.result(30.0)


def load_what_is_not_there() -> None:
    from kmn_perception.configuration import resources

    resources.find("config/models", "not there")
