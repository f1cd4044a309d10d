"""Real nodes in one process: each in its own executor and thread, in an isolated domain."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from typing import Any, TypeVar

import domain_coordinator
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.msg import Log, SetParametersResult
from rcl_interfaces.srv import SetParametersAtomically
from rclpy.context import Context
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from sensor_msgs.msg import CameraInfo, Image, PointCloud2
from visualization_msgs.msg import Marker, MarkerArray

from kmn_msgs.msg import MorphingParameters
from kmn_msgs.srv import EstimateMorphing
from kmn_perception.morph_node import MorphNode
from kmn_perception.node_parameters import DESCRIPTORS

TIMEOUT = 120.0  # seconds until a test gives up to wait

Found = TypeVar("Found")


class Graph:
    """Nodes that spin in the background, in one isolated domain."""

    def __init__(self, context: Context, stack: ExitStack) -> None:
        self.context, self._stack = context, stack

    def start(self, make_node: Callable[..., Node], **options: Any) -> Any:
        """Make a node and spin it until the end of the test."""
        return self._stack.enter_context(self.running(make_node, **options))

    @contextmanager
    def running(self, make_node: Callable[..., Node], **options: Any) -> Iterator[Any]:
        """Make a node and spin it until the end of the context."""
        node = make_node(context=self.context, **options)
        with spinning(node):
            yield node

    @staticmethod
    def wait_for(find: Callable[[], Found | None]) -> Found:
        """Wait until a function finds something, and return it."""
        deadline = time.monotonic() + TIMEOUT
        while time.monotonic() < deadline:
            if found := find():
                return found
            time.sleep(0.01)
        raise TimeoutError(f"nothing found within {TIMEOUT} s")


class Client(Node):
    """Publishes what a camera would, and keeps what morph_node answers."""

    def __init__(self, graph: Graph) -> None:
        super().__init__("client", context=graph.context)
        self.graph = graph
        self.points = self.create_publisher(PointCloud2, "points", 10)
        self.image = self.create_publisher(Image, "depth/image", 10)
        self.info = self.create_publisher(CameraInfo, "depth/camera_info", 10)
        self.answers: list[MorphingParameters] = []
        self.overlays: list[list[Marker]] = []
        self.reports: list[dict[str, str]] = []
        self.log: list[str] = []
        self.create_subscription(
            MorphingParameters, "morphing_parameters", self.answers.append, 10000
        )
        self.create_subscription(MarkerArray, "morphed_model", self._keep_overlay, 10000)
        self.create_subscription(DiagnosticArray, "/diagnostics", self._keep_report, 10)
        self.create_subscription(Log, "/rosout", self._keep_log, 100)
        self.estimation = self.create_client(EstimateMorphing, "estimate_morphing")
        self.setting = self.create_client(
            SetParametersAtomically, "morph_node/set_parameters_atomically"
        )

    def _keep_report(self, report: DiagnosticArray) -> None:
        status = report.status[0]
        self.reports.append({value.key: value.value for value in status.values})

    def _keep_overlay(self, overlay: MarkerArray) -> None:
        self.overlays.append(overlay.markers)

    def _keep_log(self, log: Log) -> None:
        self.log.append(log.msg)

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

    def call(self, service: Any, request: Any) -> Any:
        future = service.call_async(request)
        self.graph.wait_for(future.done)
        return future.result()

    def set(self, **values: Any) -> SetParametersResult:
        """Set parameters of morph_node, all or none."""
        request = SetParametersAtomically.Request(
            parameters=[Parameter(name, value=v).to_parameter_msg() for name, v in values.items()]
        )
        return self.call(self.setting, request).result

    def report(self) -> dict[str, str]:
        """Wait for a report that counts all that was answered so far."""
        self.reports.clear()
        return self.graph.wait_for(lambda: self.reports)[-1]


@contextmanager
def spinning(node: Node) -> Iterator[None]:
    """Spin a node in a thread, and destroy it at the end."""
    executor = SingleThreadedExecutor(context=node.context)
    executor.add_node(node)

    def spin() -> None:
        with suppress(ExternalShutdownException):
            executor.spin()

    thread = threading.Thread(target=spin, name=f"{node.get_name()} executor")
    thread.start()
    try:
        yield
    finally:
        executor.shutdown()
        thread.join()
        node.destroy_node()


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
    changeable = [name for name in DESCRIPTORS if not DESCRIPTORS[name].read_only]
    values = {name: node.get_parameter(name).value for name in changeable}
    yield
    assert client.set(**values).successful
