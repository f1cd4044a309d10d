"""Replay of rosbag2 recordings: real nodes, real middleware."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from array import array
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.serialization import serialize_message
from rosbags.interfaces import (
    Qos,
    QosDurability,
    QosHistory,
    QosLiveliness,
    QosReliability,
    QosTime,
)
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import String

from kmn_perception.bags import replay as replay_module
from kmn_perception.bags.replay import Replay
from kmn_perception.bags.rosbag2 import BagError, Message, write_bag

STRING = "std_msgs/msg/String"
REPLAY = [sys.executable, "-m", "kmn_perception", "replay"]
PATIENCE = 20.0  # seconds; far more than anything here takes
QUEUE_DEPTH = 100
NO_LIMIT = QosTime(9223372036, 854775807)


@pytest.fixture
def player(domain: int) -> Iterator[Node]:
    """Return the node that replays, and that listens to what is replayed."""
    context = Context()
    context.init(domain_id=domain)
    node = Node("player", context=context)
    yield node
    node.destroy_node()
    context.shutdown()


def listen(
    node: Node, message_type: Any, topic: str, qos: QoSProfile | int = QUEUE_DEPTH
) -> list[Any]:
    """Return the list of all that will be heard of a topic."""
    heard: list[Any] = []
    node.create_subscription(message_type, topic, heard.append, qos)
    return heard


def spin_until(node: Node, done: Callable[[], bool]) -> bool:
    executor = SingleThreadedExecutor(context=node.context)
    executor.add_node(node)
    deadline = time.monotonic() + PATIENCE
    while not done() and time.monotonic() < deadline:
        executor.spin_once(timeout_sec=0.05)
    return done()


def _said(topic: str, milliseconds: int, text: str) -> Message:
    return Message(topic, 10**18 + milliseconds * 10**6, serialize_message(String(data=text)))


def _write_talk(bag: Path) -> list[Message]:
    """Write a bag in which two topics talk by turns; return its messages in recorded order."""
    talk = [
        _said("/a", 0, "a0"),
        _said("/b", 10, "b0"),
        _said("/a", 20, "a1"),
        _said("/a", 70, "a2"),
        _said("/b", 200, "b1"),
    ]
    write_bag(bag, {"/a": STRING, "/b": STRING}, reversed(talk))
    return talk


@pytest.fixture
def talk(tmp_path: Path) -> Path:
    _write_talk(tmp_path / "talk")
    return tmp_path / "talk"


def test_every_message_arrives_as_it_was_recorded(player: Node, tmp_path: Path) -> None:
    talk = _write_talk(tmp_path / "talk")
    a, b = listen(player, String, "a"), listen(player, String, "b")
    replay = Replay(player, tmp_path / "talk")
    assert replay.wait_for_subscriber(PATIENCE)
    assert list(replay.play(rate=10.0)) == talk
    assert spin_until(player, lambda: len(a) + len(b) == len(talk))
    assert [message.data for message in a] == ["a0", "a1", "a2"]
    assert [message.data for message in b] == ["b0", "b1"]


class Clock:
    """A clock on which sleeping takes as long as asked."""

    def __init__(self) -> None:
        self.now = 100.0

    def monotonic(self) -> float:
        return self.now

    def sleep(self, seconds: float) -> None:
        assert seconds >= 0.0
        self.now += seconds


@pytest.mark.parametrize("rate", [0.5, 1.0, 4.0])
def test_the_pace_is_the_recorded_one_times_the_rate_and_does_not_drift(
    rate: float, player: Node, talk: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    clock = Clock()
    monkeypatch.setattr(replay_module, "time", clock)
    published = []
    for _ in Replay(player, talk).play(rate):
        published.append(clock.now - 100.0)
        clock.now += 0.002
    assert published == pytest.approx([t / rate for t in (0.0, 0.010, 0.020, 0.070, 0.200)])


def test_late_messages_follow_at_once_and_those_after_them_are_on_time(
    player: Node, talk: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    clock = Clock()
    monkeypatch.setattr(replay_module, "time", clock)
    published = []
    for message in Replay(player, talk).play():
        published.append(clock.now - 100.0)
        clock.now += 0.100 if message.topic == "/b" else 0.0
    assert published == pytest.approx([0.0, 0.010, 0.110, 0.110, 0.200])


def test_topics_can_be_chosen(player: Node, talk: Path) -> None:
    replay = Replay(player, talk, topics=["/b"])
    assert replay.count == 2
    assert {message.topic for message in replay.play(rate=10.0)} == {"/b"}


def _qos(durability: QosDurability) -> Qos:
    """Return a publisher's quality of service as `ros2 bag record` writes it."""
    return Qos(
        QosHistory.UNKNOWN, 0, QosReliability.RELIABLE, durability,
        NO_LIMIT, NO_LIMIT, QosLiveliness.AUTOMATIC, NO_LIMIT, False,
    )  # fmt: skip


def test_a_foreign_bag_is_replayed_under_other_names(player: Node, tmp_path: Path) -> None:
    """The bag is serialised and laid out by rosbags alone."""
    store = get_typestore(Stores.ROS2_JAZZY)
    types, type_name = store.types, "sensor_msgs/msg/PointCloud2"
    points = np.arange(12, dtype="<f4")
    header = types["std_msgs/msg/Header"](types["builtin_interfaces/msg/Time"](5, 7), "camera")
    fields = [
        types["sensor_msgs/msg/PointField"](name, 4 * axis, 7, 1) for axis, name in enumerate("xyz")
    ]
    cloud = types[type_name](header, 2, 2, fields, False, 12, 24, points.view(np.uint8), False)
    with Writer(tmp_path / "bag", version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connection = writer.add_connection(
            "/camera/depth/points", type_name, typestore=store,
            offered_qos_profiles=[_qos(QosDurability.VOLATILE)],
        )  # fmt: skip
        writer.write(connection, 10**18, store.serialize_cdr(cloud, type_name))
    heard = listen(player, PointCloud2, "points")
    replay = Replay(player, tmp_path / "bag", topic_map={"/camera/depth/points": "points"})
    assert replay.wait_for_subscriber(PATIENCE)
    list(replay.play())
    assert spin_until(player, lambda: bool(heard))
    (message,) = heard
    assert (message.header.frame_id, message.header.stamp.sec) == ("camera", 5)
    assert [field.name for field in message.fields] == ["x", "y", "z"]
    assert message.data == array("B", points.tobytes())


def test_latched_topics_reach_those_who_come_late(player: Node, tmp_path: Path) -> None:
    store = get_typestore(Stores.ROS2_JAZZY)
    with Writer(tmp_path / "bag", version=9, storage_plugin=StoragePlugin.SQLITE3) as writer:
        for topic, durability in (
            ("/now", QosDurability.VOLATILE), ("/ever", QosDurability.TRANSIENT_LOCAL),
        ):  # fmt: skip
            connection = writer.add_connection(
                topic, STRING, typestore=store, offered_qos_profiles=[_qos(durability)]
            )
            writer.write(connection, 0, serialize_message(String(data=topic)))
    replay = Replay(player, tmp_path / "bag")
    list(replay.play())
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    now, ever = listen(player, String, "now"), listen(player, String, "ever", latched)
    assert spin_until(player, lambda: bool(ever))
    assert ever[0].data == "/ever"
    assert not now


def test_unknown_message_packages_are_skipped_with_a_message(
    player: Node, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    store = get_typestore(Stores.ROS2_JAZZY)
    store.register(get_types_from_msg("int32 weight", "acme_msgs/msg/Anvil"))
    with Writer(tmp_path / "bag", version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        anvil = writer.add_connection("/anvil", "acme_msgs/msg/Anvil", typestore=store)
        said = writer.add_connection("/said", STRING, typestore=store)
        writer.write(anvil, 0, bytes(8))
        writer.write(said, 1, serialize_message(String(data="hello")))
    replay = Replay(player, tmp_path / "bag")
    assert [message.topic for message in replay.play()] == ["/said"]
    assert "skipping /anvil: message type acme_msgs/msg/Anvil is not" in capfd.readouterr().err
    with pytest.raises(BagError, match="nothing to publish"):
        Replay(player, tmp_path / "bag", topics=["/anvil"])


def test_a_topic_that_is_not_recorded_is_refused(player: Node, talk: Path) -> None:
    with pytest.raises(BagError, match="no topic /points; the bag holds /a, /b"):
        Replay(player, talk, topics=["/points"])
    with pytest.raises(BagError, match="no topic /depth; the bag holds /a, /b"):
        Replay(player, talk, topic_map={"/depth": "/a"})


def test_a_gap_of_years_is_skipped_with_a_message(
    player: Node,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    year = 365 * 24 * 3600 * 1000
    said = [_said("/a", 0, "a0"), _said("/a", year, "a1"), _said("/a", year + 50, "a2")]
    write_bag(tmp_path / "bag", {"/a": STRING}, said)
    clock = Clock()
    monkeypatch.setattr(replay_module, "time", clock)
    published = [clock.now - 100.0 for _ in Replay(player, tmp_path / "bag").play()]
    assert published == pytest.approx([0.0, 0.0, 0.050])
    assert "skipping a gap of 8760.0 hours" in capfd.readouterr().err


def _run_replay(domain: int, *arguments: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [*REPLAY, *arguments],
        env={**os.environ, "ROS_DOMAIN_ID": str(domain)},
        stderr=subprocess.PIPE,
        text=True,
    )


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["nowhere"], "nowhere: no such bag"),
        (["BAG", "--rate", "0"], "0 is not a positive number"),
        (["BAG", "--rate", "nan"], "nan is not a positive number"),
        (["BAG", "--topics", "/points"], "no topic /points; the bag holds /a, /b"),
        (["BAG", "--topic-map", "/a=/b"], "/a=/b is not of the form FROM:=TO"),
        (["BAG", "--topic-map", "/a:=no good"], "Invalid topic name"),
    ],
)
def test_bad_arguments_end_with_a_message(
    arguments: list[str], message: str, domain: int, talk: Path
) -> None:
    process = _run_replay(domain, *[str(talk) if text == "BAG" else text for text in arguments])
    _, errors = process.communicate(timeout=60)
    assert process.returncode in (1, 2)
    assert message in errors
    assert "Traceback" not in errors


def test_ctrl_c_ends_an_endless_replay_without_a_traceback(
    domain: int, player: Node, talk: Path
) -> None:
    heard = listen(player, String, "a")
    process = _run_replay(domain, str(talk), "--loop")
    try:
        assert spin_until(player, lambda: len(heard) > 6), "it does not start again at the end"
        process.send_signal(signal.SIGINT)
        _, errors = process.communicate(timeout=60)
    finally:
        process.kill()
    assert process.returncode == 0
    assert "Traceback" not in errors
