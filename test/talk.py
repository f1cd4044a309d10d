"""Recordings of two topics that talk by turns, and a node that listens to their replay."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.serialization import serialize_message
from std_msgs.msg import String

from kmn_perception.bags.rosbag2 import Message, write_bag

STRING = "std_msgs/msg/String"
PATIENCE = 20.0  # seconds; far more than anything here takes
QUEUE_DEPTH = 100


def listen(
    node: Node, message_type: Any, topic: str, qos: QoSProfile | int = QUEUE_DEPTH
) -> list[Any]:
    """Return the list of all that will be heard of a topic."""
    heard: list[Any] = []
    node.create_subscription(message_type, topic, heard.append, qos)
    return heard


def spin_until(node: Node, done: Callable[[], bool]) -> bool:
    """Spin a node until a condition holds, or patience is over; return whether it holds."""
    executor = SingleThreadedExecutor(context=node.context)
    executor.add_node(node)
    deadline = time.monotonic() + PATIENCE
    while not done() and time.monotonic() < deadline:
        executor.spin_once(timeout_sec=0.05)
    return done()


def said(topic: str, milliseconds: int, text: str) -> Message:
    """Return a text that was recorded on a topic at a time."""
    return Message(topic, 10**18 + milliseconds * 10**6, serialize_message(String(data=text)))


def write_talk(bag: Path) -> list[Message]:
    """Write a bag in which two topics talk by turns; return its messages in recorded order."""
    talk = [
        said("/a", 0, "a0"),
        said("/b", 10, "b0"),
        said("/a", 20, "a1"),
        said("/a", 70, "a2"),
        said("/b", 200, "b1"),
    ]
    write_bag(bag, {"/a": STRING, "/b": STRING}, reversed(talk))
    return talk
