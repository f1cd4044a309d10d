"""The real Kinect frames, replayed by another process into morph_node."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import cv2
import pytest
from rclpy.time import Time

from kmn_msgs.msg import MorphingParameters
from kmn_perception.bags.example_bag import make_example_bag
from kmn_perception.bags.rosbag2 import read_messages
from kmn_perception.configuration import resources
from kmn_perception.ros.morph_node import MorphNode

PICTURES = resources.share_directory() / "data" / "kinect_boxes"


@pytest.fixture(scope="module")
def node(graph: Any) -> MorphNode:
    """Start a node for boxes on a table, as a user would."""
    file = resources.find("config/nodes", "morph_node_tabletop")
    values = ["-p", "reliability:=reliable"]
    return graph.start(MorphNode, cli_args=["--ros-args", "--params-file", str(file), *values])


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("kinect") / "bag"
    make_example_bag(path, rate=4.0)
    return path


def _labelled(number: int) -> list[int]:
    """Return how many pixels were labelled as each object of a frame by hand."""
    labels = cv2.imread(str(PICTURES / f"learn{number}_l.png"), cv2.IMREAD_UNCHANGED)
    assert labels is not None
    return [int((labels == label).sum()) for label in (20, 30, 40)]


@pytest.mark.parametrize(
    "topics",
    [pytest.param(["/points"], marks=pytest.mark.slow), ["/depth/image", "/depth/camera_info"]],
)
def test_frames_from_another_process_are_answered_with_one_object_each(
    topics: list[str], bag: Path, client: Any, domain: int
) -> None:
    before = client.report()
    client.answers.clear()
    command = [sys.executable, "-m", "kmn_perception", "replay", str(bag), "--topics", *topics]
    environment = {**os.environ, "ROS_DOMAIN_ID": str(domain)}
    assert subprocess.run(command, env=environment, timeout=120, check=False).returncode == 0
    stamps = [message.stamp for message in read_messages(bag, topics[:1])]
    client.answer(Time(nanoseconds=stamps[-1]).to_msg())
    after = client.report()
    received, dropped = (
        int(after[key]) - int(before[key]) for key in ("frames_received", "frames_dropped")
    )
    assert received == len(stamps) == 17
    assert len(client.answers) == received - dropped
    for answer in client.answers:
        number = stamps.index(Time.from_msg(answer.header.stamp).nanoseconds)
        assert (answer.model, answer.status) == ("box", MorphingParameters.OK), answer.reason
        assert (
            min(abs(answer.points_used / count - 1.0) for count in _labelled(number) if count) < 0.1
        )
