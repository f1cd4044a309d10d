"""What comes of each topic, and what is wrong with it, for the page to tell."""

from __future__ import annotations

import time
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple

from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message
from rclpy.subscription import Subscription

from kmn_perception.ros.messages import MessageError
from kmn_perception.ros.reports import ThrottledWarnings
from kmn_perception.transforms.transform import TransformError
from kmn_perception.viewer.drawing import plain

EXPECTED = (MessageError, TransformError, ValueError, OSError)
OLD = 3.0  # seconds after which what comes all the time counts as missing


class Inputs:
    """Keeps when each topic was heard last, and the present fault of each part of the view."""

    def __init__(self, node: Node) -> None:
        self._logger, self._warnings = node.get_logger(), ThrottledWarnings(node)
        self._heard: dict[str, float | None] = {}
        self._faults: dict[str, str] = {}

    def expect(self, topic: str) -> None:
        """Tell of a topic even if it never comes."""
        self._heard.setdefault(topic, None)

    def hear(self, topic: str) -> None:
        """Note that a topic was heard."""
        self._heard[topic] = time.monotonic()

    @contextmanager
    def part(self, name: str) -> Iterator[None]:
        """Let what is wrong in a context be told under a name, instead of ending the viewer."""
        try:
            yield
        except EXPECTED as error:
            self._faults[name] = str(error)
        except Exception as error:  # of a library, by a message that nobody thought of
            self._faults[name] = f"internal error: {error!r}"
            self._warnings.warn(name, "".join(traceback.format_exception(error)))
        else:
            self._faults.pop(name, None)

    def table(self) -> str:
        """Return all of it in Markdown."""
        lines = ["| topic | |", "| --- | --- |"]
        now = time.monotonic()
        for topic, heard in self._heard.items():
            age = "not heard yet" if heard is None else "comes"
            if heard is not None and now - heard > OLD:
                age = f"last heard {now - heard:.0f} s ago"
            lines.append(f"| `{topic}` | {age} |")
        faults = [f"- {plain(name)}: {plain(text)}" for name, text in self._faults.items()]
        return "\n".join([*lines, "", *faults])


class Newest(NamedTuple):
    """Bytes of a message and its type."""

    data: bytes
    kind: Any

    def message(self) -> Any:
        """Return the message."""
        return deserialize_message(self.data, self.kind)


class NewestOnly:
    """Subscribes to what is large, and keeps the newest message unread until it is wanted.

    Parameters
    ----------
    node, inputs
        Who subscribes, and where it is told what came.
    """

    def __init__(self, node: Node, inputs: Inputs) -> None:
        self._node, self._inputs = node, inputs
        self._subscriptions: dict[str, Subscription] = {}
        self._newest: dict[str, Newest] = {}

    def listen(self, topic: str, kind: Any, wanted: bool) -> None:
        """Subscribe, or no longer."""
        name = self._node.resolve_topic_name(topic)
        if wanted and topic not in self._subscriptions:
            self._inputs.expect(name)
            # What a slow network loses is not sent again: nobody waits for who looks on.
            newest = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
            self._subscriptions[topic] = self._node.create_subscription(
                kind, topic, self._keeper(topic, name, kind), newest, raw=True
            )
        elif not wanted and topic in self._subscriptions:
            self._node.destroy_subscription(self._subscriptions.pop(topic))
            self._newest.pop(topic, None)

    def take(self, topic: str) -> Any:
        """Take the newest message that was not taken yet, or None."""
        newest = self._newest.pop(topic, None)
        return None if newest is None else newest.message()

    def _keeper(self, topic: str, name: str, kind: Any) -> Callable[[bytes], None]:
        def keep(data: bytes) -> None:
            self._newest[topic] = Newest(data, kind)
            self._inputs.hear(name)

        return keep
