"""What all tests of nodes share: places to start nodes in, and morph_node with a client of it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import domain_coordinator
import pytest
from rclpy.context import Context
from rclpy.node import Node
from rclpy.parameter import Parameter
from sensor_msgs.msg import CameraInfo, Image, PointCloud2
from visualization_msgs.msg import Marker, MarkerArray

from graph import Graph, GraphClient
from kmn_msgs.msg import MorphingParameters
from kmn_msgs.srv import EstimateMorphing
from kmn_perception.configuration.node_parameters import load_node_parameters
from kmn_perception.ros.morph_node import MorphNode
from talk import write_talk


class Client(GraphClient):
    """Publishes what a camera would, and keeps what morph_node answers."""

    def __init__(self, graph: Graph) -> None:
        super().__init__(graph, "morph_node")
        self.points = self.create_publisher(PointCloud2, "points", 10)
        self.image = self.create_publisher(Image, "depth/image", 10)
        self.info = self.create_publisher(CameraInfo, "depth/camera_info", 10)
        self.answers: list[MorphingParameters] = []
        self.overlays: list[list[Marker]] = []
        self.create_subscription(
            MorphingParameters, "morphing_parameters", self.answers.append, 10000
        )
        self.create_subscription(MarkerArray, "morphed_model", self._keep_overlay, 10000)
        self.estimation = self.create_client(EstimateMorphing, "estimate_morphing")

    def _keep_overlay(self, overlay: MarkerArray) -> None:
        self.overlays.append(overlay.markers)

    def connect(self) -> None:
        """Wait until morph_node hears and is heard."""
        for publisher in (self.points, self.image, self.info):
            self.graph.wait_for(publisher.get_subscription_count)
        self.estimation.wait_for_service()
        self.setting.wait_for_service()
        self.graph.wait_for(lambda: self.reports)

    def answer(self, stamp: Any) -> MorphingParameters:
        """Wait for the answer to the frame of a stamp."""
        return self.graph.wait_for(
            lambda: next((a for a in self.answers if a.header.stamp == stamp), None)
        )

    def overlay(self, stamp: Any) -> list[Marker]:
        """Wait for the overlay of the frame of a stamp."""
        return self.graph.wait_for(
            lambda: next((m for m in self.overlays if m[0].header.stamp == stamp), None)
        )

    def ask(self, cloud: PointCloud2) -> MorphingParameters:
        self.points.publish(cloud)
        return self.answer(cloud.header.stamp)

    def ask_depth(self, image: Image, info: CameraInfo) -> MorphingParameters:
        """Publish an image, whose camera_info is sure to have come before it."""
        self.info.publish(info)
        self.info.wait_for_all_acked()
        self.image.publish(image)
        return self.answer(image.header.stamp)


@pytest.fixture(scope="module")
def domain() -> Iterator[int]:
    """Return the id of a domain that no other test uses."""
    with domain_coordinator.domain_id() as number:
        yield number


@pytest.fixture(scope="module")
def graph(domain: int) -> Iterator[Graph]:
    """Return a place to start nodes in."""
    context = Context()
    context.init(domain_id=domain)
    with ExitStack() as stack:
        stack.callback(context.try_shutdown)
        yield Graph(context, stack)


@pytest.fixture(scope="module")
def node(graph: Any) -> MorphNode:
    """Start a node whose subscriptions are reliable, so that no test waits for a lost message."""
    overrides = [Parameter("reliability", value="reliable")]
    return graph.start(MorphNode, parameter_overrides=overrides)


@pytest.fixture(scope="module")
def client(graph: Any, node: MorphNode) -> Client:
    made = graph.start(lambda **_: Client(graph))
    made.connect()
    return made


@pytest.fixture
def restored(client: Client, node: MorphNode) -> Iterator[None]:
    """Give all parameters their former values back after the test."""
    stated = load_node_parameters("morph_node")
    changeable = [name for name in stated if not stated[name].read_only]
    values = {name: node.get_parameter(name).value for name in changeable}
    yield
    assert client.set(**values).successful


@pytest.fixture
def player(domain: int) -> Iterator[Node]:
    """Return the node that replays, and that listens to what is replayed."""
    context = Context()
    context.init(domain_id=domain)
    node = Node("player", context=context)
    yield node
    node.destroy_node()
    context.shutdown()


@pytest.fixture
def talk(tmp_path: Path) -> Path:
    """Write a bag in which two topics talk by turns."""
    write_talk(tmp_path / "talk")
    return tmp_path / "talk"
