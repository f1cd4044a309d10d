"""Publish a rosbag2 recording at its recorded pace."""

from __future__ import annotations

import argparse
import importlib
import math
import time
from collections.abc import Collection, Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from tqdm import tqdm

from kmn_perception.bags.rosbag2 import (
    BagError,
    Message,
    Topic,
    check_topics,
    read_messages,
    read_topics,
)
from kmn_perception.ros.program import own_arguments, ros_session

QUEUE_DEPTH = 10
MAX_GAP = 3600.0  # recorded seconds between two messages; longer ones are a clock that was set
DISCOVERY_PERIOD = 0.05  # seconds between two looks for a subscriber
DISCOVERY_MARGIN = 0.5  # seconds for the subscriber to find the publishers too
FLUSH_TIMEOUT = 5.0  # seconds for the subscribers to acknowledge the last messages


class Replay:
    """Publishers for the topics of a bag, which publish the recorded bytes as they are.

    Parameters
    ----------
    node : Node
        Node that owns the publishers.
    bag : Path
        The recording.
    topics : collection of str
        Recorded topics to publish; all if empty.
    topic_map : mapping of str to str
        Other names for recorded topics.

    Raises
    ------
    BagError
        The bag is unreadable, lacks a topic, or holds nothing that can be published.
    """

    def __init__(
        self,
        node: Node,
        bag: Path,
        topics: Collection[str] = (),
        topic_map: Mapping[str, str] | None = None,
    ) -> None:
        topic_map = topic_map or {}
        recorded = read_topics(bag)
        check_topics(bag, recorded, [*topics, *topic_map])
        self._node, self._bag = node, bag
        self._publishers: dict[str, Publisher] = {}
        for name in topics or recorded:
            if message_type := find_message_type(recorded[name].type):
                self._publishers[name] = node.create_publisher(
                    message_type, topic_map.get(name, name), _quality_of_service(recorded[name])
                )
            else:
                node.get_logger().warning(
                    f"skipping {name}: message type {recorded[name].type} is not installed"
                )
        self.count = sum(recorded[name].count for name in self._publishers)
        if not self.count:
            raise BagError(f"{bag}: nothing to publish")

    def wait_for_subscriber(self, timeout: float) -> bool:
        """Wait at most `timeout` seconds for a subscriber, so that it misses no first message."""
        deadline = time.monotonic() + timeout
        while not any(p.get_subscription_count() for p in self._publishers.values()):
            if time.monotonic() > deadline:
                return False
            time.sleep(DISCOVERY_PERIOD)
        time.sleep(DISCOVERY_MARGIN)
        return True

    def play(self, rate: float = 1.0) -> Iterator[Message]:
        """Publish each message when it is due, `rate` times as fast as recorded, and yield it.

        The time table is that of the recording, so that delays do not add up. Where the recorder's
        clock was set, the gap is skipped.
        """
        due, last = time.monotonic(), None
        for message in read_messages(self._bag, self._publishers.keys()):
            gap = 0.0 if last is None else (message.stamp - last) * 1e-9
            last = message.stamp
            if gap > MAX_GAP:
                self._node.get_logger().warning(
                    f"skipping a gap of {gap / 3600.0:.1f} hours in {self._bag}: "
                    f"the clock was set while it was recorded"
                )
                gap = 0.0
            due += gap / rate
            time.sleep(max(due - time.monotonic(), 0.0))
            self._publishers[message.topic].publish(message.data)
            yield message

    def flush(self) -> None:
        """Wait until reliable subscribers have acknowledged what was published."""
        for publisher in self._publishers.values():
            publisher.wait_for_all_acked(Duration(seconds=FLUSH_TIMEOUT))


def find_message_type(name: str) -> Any | None:
    """Return the class of a message type such as ``sensor_msgs/msg/Image``, None if not here."""
    package, _, type_ = name.partition("/msg/")
    try:
        return getattr(importlib.import_module(f"{package}.msg"), type_, None)
    except ImportError:
        return None


def _quality_of_service(topic: Topic) -> QoSProfile:
    """Reliable, as REP-2003 has it for publishers; latched where the recorded one was."""
    return QoSProfile(
        depth=QUEUE_DEPTH,
        reliability=ReliabilityPolicy.RELIABLE,
        durability=(
            DurabilityPolicy.TRANSIENT_LOCAL if topic.latched else DurabilityPolicy.VOLATILE
        ),
    )


def _parse(arguments: list[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="replay", description=__doc__)
    parser.add_argument("bag", type=Path, help="rosbag2 folder, or one .mcap or .db3 file")
    parser.add_argument(
        "--rate", type=positive_number, default=1.0, help="times the recorded pace (default 1)"
    )
    parser.add_argument("--loop", action="store_true", help="start again at the end")
    parser.add_argument(
        "--topics", nargs="+", default=[], metavar="TOPIC", help="publish these only"
    )
    parser.add_argument(
        "--topic-map", nargs="+", default=[], type=topic_mapping, metavar="FROM:=TO",
        help="publish a recorded topic under another name",
    )  # fmt: skip
    parser.add_argument(
        "--wait", type=positive_number, default=10.0, metavar="SECONDS",
        help="longest time to wait for a subscriber before starting (default 10)",
    )  # fmt: skip
    return parser.parse_args(arguments)


def positive_number(text: str) -> float:
    """Parse an argument that must be finite and above zero."""
    number = float(text)
    if not 0.0 < number < math.inf:
        raise argparse.ArgumentTypeError(f"{text} is not a positive number")
    return number


def topic_mapping(text: str) -> tuple[str, str]:
    """Parse ``FROM:=TO`` into the recorded and the published topic."""
    recorded, separator, published = text.partition(":=")
    if not (recorded and separator and published):
        raise argparse.ArgumentTypeError(f"{text} is not of the form FROM:=TO")
    return recorded, published


def _run(node: Node, options: argparse.Namespace) -> None:
    replay = Replay(node, options.bag, options.topics, dict(options.topic_map))
    if not replay.wait_for_subscriber(options.wait):
        node.get_logger().warning(f"no subscriber within {options.wait:g} s; playing all the same")
    while True:
        for _ in tqdm(replay.play(options.rate), total=replay.count, unit="msg"):
            pass
        if not options.loop:
            break
    replay.flush()


def main() -> int:
    """Run the executable ``replay``."""
    options = _parse(own_arguments())
    with ros_session("replay"), suppress(KeyboardInterrupt):  # the normal end of a loop
        _run(Node("replay"), options)
    return 0
