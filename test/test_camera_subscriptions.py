"""Subscriptions to a camera are as reliable as its publishers, which DDS tells another node."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import CameraInfo, PointCloud2

from kmn_perception.ros.camera_subscriptions import PERIOD, CameraSubscriptions
from kmn_perception.ros.morph_node import MorphNode

BEST_AVAILABLE, RELIABLE, BEST_EFFORT = (
    ReliabilityPolicy.BEST_AVAILABLE,
    ReliabilityPolicy.RELIABLE,
    ReliabilityPolicy.BEST_EFFORT,
)


class Listener(Node):
    """Keeps the clouds of a camera."""

    def __init__(self, reliability: ReliabilityPolicy, **options: Any) -> None:
        super().__init__("listener", **options)
        self.heard: list[PointCloud2] = []
        self.camera = CameraSubscriptions(self, reliability)
        self.listening = self.camera.subscribe(PointCloud2, "points", self.heard.append)


@pytest.fixture(scope="module")
def camera(graph: Any) -> Iterator[Node]:
    node = Node("camera", context=graph.context)
    yield node
    node.destroy_node()


@contextmanager
def publishing(node: Node, reliability: ReliabilityPolicy) -> Iterator[Publisher]:
    """Publish clouds in a way."""
    newest = QoSProfile(depth=1, reliability=reliability)
    publisher = node.create_publisher(PointCloud2, "points", newest)
    try:
        yield publisher
    finally:
        node.destroy_publisher(publisher)


def told(node: Node) -> list[ReliabilityPolicy]:
    """Return how reliable the subscriptions to the clouds are."""
    infos = node.get_subscriptions_info_by_topic("points")
    return [info.qos_profile.reliability for info in infos]


def wait_for_clouds(graph: Any, publisher: Publisher, heard: list[PointCloud2]) -> None:
    """Publish clouds until one is heard."""

    def comes() -> bool:
        publisher.publish(PointCloud2())
        return bool(heard)

    graph.wait_for(comes)


def test_they_follow_what_publishers_offer(graph: Any, camera: Node) -> None:
    with graph.running(Listener, reliability=BEST_AVAILABLE):
        graph.wait_for(lambda: told(camera) == [BEST_EFFORT])
        with publishing(camera, RELIABLE):
            graph.wait_for(lambda: told(camera) == [RELIABLE])
            with publishing(camera, BEST_EFFORT):  # which a reliable subscription would not hear
                graph.wait_for(lambda: told(camera) == [BEST_EFFORT])
            graph.wait_for(lambda: told(camera) == [RELIABLE])
        with publishing(camera, BEST_EFFORT):
            graph.wait_for(lambda: told(camera) == [BEST_EFFORT])


@pytest.mark.parametrize("offered", [[RELIABLE], [BEST_EFFORT], [RELIABLE, BEST_EFFORT]])
def test_clouds_come_however_they_are_published(
    graph: Any, camera: Node, offered: list[ReliabilityPolicy]
) -> None:
    with graph.running(Listener, reliability=BEST_AVAILABLE) as node:
        for number, reliability in enumerate(offered):
            with publishing(camera, reliability) as publisher:
                cloud = PointCloud2(width=number)

                def comes(publisher: Publisher = publisher, cloud: PointCloud2 = cloud) -> bool:
                    publisher.publish(cloud)
                    return cloud in node.heard

                graph.wait_for(comes)


def test_what_is_not_wanted_any_more_stays_away(graph: Any, camera: Node) -> None:
    with (
        publishing(camera, RELIABLE),
        graph.running(Listener, reliability=BEST_AVAILABLE) as node,
    ):
        graph.wait_for(lambda: told(camera) == [RELIABLE])
        node.camera.end(node.listening)
        graph.wait_for(lambda: told(camera) == [])
        time.sleep(3.0 * PERIOD)
        assert told(camera) == []


def test_two_subscriptions_to_one_topic_do_not_know_of_each_other(graph: Any, camera: Node) -> None:
    with graph.running(Listener, reliability=BEST_AVAILABLE) as node:
        again: list[PointCloud2] = []
        second = node.camera.subscribe(PointCloud2, "points", again.append)
        with publishing(camera, RELIABLE):
            graph.wait_for(lambda: told(camera) == 2 * [RELIABLE])
        with publishing(camera, BEST_EFFORT) as publisher:
            graph.wait_for(lambda: told(camera) == 2 * [BEST_EFFORT])
            for heard in (node.heard, again):
                wait_for_clouds(graph, publisher, heard)
            node.camera.end(second)
            graph.wait_for(lambda: told(camera) == [BEST_EFFORT])
            node.heard.clear()
            wait_for_clouds(graph, publisher, node.heard)


def test_one_description_for_depth_and_image_is_heard_whether_images_are_used_or_not(
    graph: Any, camera: Node
) -> None:
    arguments = ["--ros-args", "-r", "depth/camera_info:=info", "-r", "image/camera_info:=info"]
    options = {"parameter_overrides": [Parameter("model", value="room_door")]}
    publisher = camera.create_publisher(CameraInfo, "info", 1)
    with graph.running(MorphNode, cli_args=arguments, **options) as node:
        for is_used in (True, False, True, False):
            node.set_parameters([Parameter("use_image", value=is_used)])
            graph.wait_for(
                lambda used=is_used: len(camera.get_subscriptions_info_by_topic("info")) == 1 + used
            )
            info = CameraInfo(width=640 + is_used)

            def comes(info: CameraInfo = info) -> bool:
                publisher.publish(info)
                return node._frames.camera_info == info

            graph.wait_for(comes)
    camera.destroy_publisher(publisher)


@pytest.mark.parametrize("name", ["reliability", "qos_overrides./points.subscription.reliability"])
@pytest.mark.parametrize(("chosen", "offered"), [(RELIABLE, BEST_EFFORT), (BEST_EFFORT, RELIABLE)])
def test_what_the_user_chose_stays(
    graph: Any,
    camera: Node,
    name: str,
    chosen: ReliabilityPolicy,
    offered: ReliabilityPolicy,
) -> None:
    values = [Parameter("model", value="box"), Parameter(name, value=chosen.name.lower())]
    with publishing(camera, offered), graph.running(MorphNode, parameter_overrides=values):
        graph.wait_for(lambda: told(camera) == [chosen])
        time.sleep(3.0 * PERIOD)
        assert told(camera) == [chosen]


def test_a_node_that_is_asked_for_nothing_follows_the_camera(graph: Any, camera: Node) -> None:
    values = [Parameter("model", value="box")]
    with publishing(camera, RELIABLE), graph.running(MorphNode, parameter_overrides=values):
        graph.wait_for(lambda: told(camera) == [RELIABLE])
