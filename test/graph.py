"""Real nodes in one process: each in its own executor and thread, in an isolated domain."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from typing import Any, TypeVar

from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.msg import Log, SetParametersResult
from rcl_interfaces.srv import SetParametersAtomically
from rclpy.context import Context
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.task import Future

from kmn_perception.ros.parameters import request_to_set

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


@contextmanager
def spinning(node: Node) -> Iterator[None]:
    """Spin a node in a thread, and destroy it at the end."""
    executor = SingleThreadedExecutor(context=node.context)
    executor.add_node(node)
    ended = Future()  # to shut an executor down while it spins may take its guards away

    def spin() -> None:
        with suppress(ExternalShutdownException):
            executor.spin_until_future_complete(ended)

    thread = threading.Thread(target=spin, name=f"{node.get_name()} executor")
    thread.start()
    try:
        yield
    finally:
        ended.set_result(None)
        thread.join()
        executor.shutdown()
        node.destroy_node()


class GraphClient(Node):
    """Sets the parameters of a node, and keeps what it reports and what all nodes log."""

    def __init__(self, graph: Graph, served_by: str) -> None:
        super().__init__("client", context=graph.context)
        self.graph, self._served_by = graph, served_by
        self.reports: list[dict[str, str]] = []
        self.log: list[str] = []
        self.create_subscription(DiagnosticArray, "/diagnostics", self._keep_report, 10)
        self.create_subscription(Log, "/rosout", self._keep_log, 100)
        self.setting = self.create_client(
            SetParametersAtomically, f"{served_by}/set_parameters_atomically"
        )

    def _keep_report(self, report: DiagnosticArray) -> None:
        if self._served_by in report.status[0].name:
            values = [value for status in report.status for value in status.values]
            self.reports.append({value.key: value.value for value in values})

    def _keep_log(self, log: Log) -> None:
        self.log.append(log.msg)

    def wait(self, future: Any) -> Any:
        self.graph.wait_for(future.done)
        return future.result()

    def send_goal(self, client: Any, goal: Any, feedback: Any = None) -> Any:
        """Return the handle of a goal, which a `LockedActionClient` sends."""
        return self.wait(client.send_goal_async(goal, feedback))

    def call(self, service: Any, request: Any) -> Any:
        return self.wait(service.call_async(request))

    def set(self, **values: Any) -> SetParametersResult:
        """Set parameters of the node, all or none."""
        return self.call(self.setting, request_to_set(values)).result

    def report(self) -> dict[str, str]:
        """Wait for a report that counts all that was answered so far."""
        self.reports.clear()
        return self.graph.wait_for(lambda: self.reports)[-1]
