"""What a node says of itself: warnings, and what it reports on ``/diagnostics``."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.node import Node

REPORT_PERIOD = 1.0  # seconds
WARNING_PERIOD = 5.0  # seconds between two warnings of the same kind
QUEUE_DEPTH = 10


class ThrottledWarnings:
    """Logs warnings of a node, but not more often than once in a period for each key."""

    def __init__(self, node: Node) -> None:
        self._logger = node.get_logger()
        self._warned: dict[str, float] = {}
        self._told: dict[str, str] = {}

    def warn_once(self, key: str, text: str) -> None:
        """Log a warning, unless the last one with this key said the same."""
        if self._told.get(key) != text:
            self._told[key] = text
            self._logger.warning(text)

    def warn(self, key: str, text: str) -> None:
        """Log a warning, unless there was one with this key just before."""
        now = time.monotonic()
        if now - self._warned.get(key, -WARNING_PERIOD) >= WARNING_PERIOD:
            self._warned[key] = now
            self._logger.warning(text)


class ChangeWarnings:
    """Logs what may last when it begins or changes, not as long as it lasts.

    What comes and goes is said again, but not more often than `ThrottledWarnings` does.
    """

    def __init__(self, node: Node) -> None:
        self._throttled = ThrottledWarnings(node)
        self._present: dict[str, str] = {}

    def warn(self, subject: str, reason: str, text: str) -> None:
        """Log a warning, unless this was the last reason already.

        Parameters
        ----------
        subject
            What it is about, e.g. a topic.
        reason
            Key that stays the same while the text may change.
        """
        if self._present.get(subject) != reason:
            self._present[subject] = reason
            self._throttled.warn(f"{subject} {reason}", text)

    def clear(self, subject: str) -> None:
        """Note that all is well with a subject."""
        self._present.pop(subject, None)


class NameWatch:
    """Notices other nodes of a node's name, whose parameters and services cannot be told apart."""

    def __init__(self, node: Node) -> None:
        self._node, self._warned = node, False

    def report(self) -> DiagnosticStatus:
        """Return how many nodes have the name; that they are several is logged once."""
        name = self._node.get_fully_qualified_name()
        found = self._node.get_node_names_and_namespaces()
        count = sum(f"{space.rstrip('/')}/{own}" == name for own, space in found)
        several = count > 1
        text = f"{count} nodes are named {name}: rename one by -r __node:=NAME or -r __ns:=/NAME"
        if several and not self._warned:
            self._warned = True
            self._node.get_logger().warning(text)
        message = text if several else "the name is unique"
        return make_status(f"{name}: name", several, message, {"nodes_of_this_name": str(count)})


def report_periodically(node: Node, report: Callable[[], list[DiagnosticStatus]]) -> None:
    """Publish on ``/diagnostics`` what ``report`` returns and the name's status, periodically."""
    publisher = node.create_publisher(DiagnosticArray, "/diagnostics", QUEUE_DEPTH)
    watch = NameWatch(node)

    def publish() -> None:
        message = DiagnosticArray(status=[*report(), watch.report()])
        message.header.stamp = node.get_clock().now().to_msg()
        publisher.publish(message)

    # A steady clock: reports go on when a simulated time stops or jumps.
    node.create_timer(REPORT_PERIOD, publish, clock=Clock(clock_type=ClockType.STEADY_TIME))


def make_status(name: str, warn: bool, message: str, values: Mapping[str, str]) -> DiagnosticStatus:
    """Return a status of ``name``, which warns or is OK."""
    return DiagnosticStatus(
        level=DiagnosticStatus.WARN if warn else DiagnosticStatus.OK,
        name=name,
        message=message,
        values=[KeyValue(key=key, value=value) for key, value in values.items()],
    )
