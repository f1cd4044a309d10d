"""A bag of the simulated sensor replays into morph_node with the same results as live."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.serialization import deserialize_message
from rclpy.time import Time
from sensor_msgs.msg import PointCloud2

from kmn_msgs.msg import MorphingParameters
from kmn_perception.bags.replay import Replay
from kmn_perception.bags.rosbag2 import Message, write_bag
from kmn_perception.ros.morph_node import MorphNode
from kmn_sim.ros.sim_node import SimNode

FRAMES = 3
TYPES = {"/points": "sensor_msgs/msg/PointCloud2"}


class Listener(Node):
    """Keeps the clouds as they were sent, and the estimates of two nodes by stamp."""

    def __init__(self, context: Any) -> None:
        super().__init__("listener", context=context)
        self.clouds: dict[int, bytes] = {}
        self.live: dict[int, MorphingParameters] = {}
        self.replayed: dict[int, MorphingParameters] = {}
        self.create_subscription(PointCloud2, "/live/points", self._keep_cloud, 10, raw=True)
        for topic, kept in (("/live", self.live), ("", self.replayed)):
            self.create_subscription(
                MorphingParameters,
                f"{topic}/morphing_parameters",
                lambda answer, kept=kept: kept.update({stamp_of(answer): answer}),  # type: ignore[misc]
                10,
            )

    def _keep_cloud(self, data: Any) -> None:
        cloud = deserialize_message(data, PointCloud2)
        self.clouds[stamp_of(cloud)] = bytes(data)


def stamp_of(message: Any) -> int:
    return Time.from_msg(message.header.stamp).nanoseconds


def test_replay_has_the_results_of_the_live_run(graph: Any, tmp_path: Path) -> None:
    reliable = Parameter("reliability", value="reliable")
    listener = graph.start(lambda **_: Listener(graph.context))
    only_clouds = ["--ros-args", "-r", "depth/image:=nothing"]  # the image is the same, rounded
    graph.start(MorphNode, namespace="live", cli_args=only_clouds, parameter_overrides=[reliable])
    graph.start(MorphNode, parameter_overrides=[reliable])
    overrides = {"placement": "random", "seed": 3, "noise": "kinect", "camera_rate": 1.0}
    graph.start(
        SimNode,
        namespace="live",
        parameter_overrides=[Parameter(name, value=value) for name, value in overrides.items()],
    )
    graph.wait_for(lambda: len(listener.clouds.keys() & listener.live.keys()) >= FRAMES)
    stamps = sorted(listener.clouds.keys() & listener.live.keys())[:FRAMES]
    messages = [Message("/points", stamp, listener.clouds[stamp]) for stamp in stamps]
    write_bag(tmp_path / "bag", TYPES, messages)
    player = graph.start(lambda **_: Node("player", context=graph.context))
    replay = Replay(player, tmp_path / "bag")
    assert replay.wait_for_subscriber(10.0)
    for message in replay.play():
        graph.wait_for(lambda stamp=message.stamp: stamp in listener.replayed)
    for stamp in stamps:
        live, replayed = listener.live[stamp], listener.replayed[stamp]
        assert (live.status, live.points_used) == (replayed.status, replayed.points_used)
        np.testing.assert_array_equal(live.theta, replayed.theta)
        np.testing.assert_array_equal(live.gamma, replayed.gamma)
