"""From a camera's exposure to the morphing parameters that tell of it, through real topics."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Iterator
from itertools import cycle
from pathlib import Path

import numpy as np
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.time import Time
from sensor_msgs.msg import CameraInfo, Image
from std_msgs.msg import Header
from tqdm import tqdm

from kmn_msgs.msg import MorphingParameters
from kmn_perception.benchmark.callbacks import DISTINCT, DOOR, RATE, Seen, door_frames
from kmn_perception.doors.settings import DoorSettings
from kmn_perception.ros.messages import image_from_depth, info_from_camera
from kmn_perception.ros.messages.writing import image_from_pixels
from kmn_perception.ros.node_process import NoAnswerError, NodeProcess

CASE = "exposure_to_parameters"
NAMESPACE = "benchmark_latency"  # nodes that run beside are left alone
START_TIMEOUT = 120.0  # seconds for the node to load, and to compile what it does with a frame
WARM_UP = 5 * DISTINCT  # answers, of which the first come from slow searches
LAST = 1.0  # seconds for the last answers to come
FOUND = (MorphingParameters.OK, MorphingParameters.HANDLE_NOT_SEEN)


class _Camera:
    """Sends depth and grey images of a door in its wall, and takes the time of the answers."""

    def __init__(self, node: Node) -> None:
        newest = QoSProfile(depth=1)
        self._publishers = [
            node.create_publisher(kind, f"{NAMESPACE}/{topic}", newest)
            for kind, topic in (
                (CameraInfo, "depth/camera_info"),
                (CameraInfo, "image/camera_info"),
                (Image, "image"),
                (Image, "depth/image"),
            )
        ]
        topic = f"{NAMESPACE}/morphing_parameters"
        self._answers = node.create_subscription(MorphingParameters, topic, self._on_answer, 10)
        self._node, self._executor = node, SingleThreadedExecutor()
        self._executor.add_node(node)
        self._frames = cycle(door_frames())
        self._due = time.monotonic()
        self._since = self._node.get_clock().now()  # what was exposed before does not count
        self.milliseconds: list[float] = []  # of each answer that tells the door

    def close(self) -> None:
        """Leave the node as it was."""
        self._executor.remove_node(self._node)
        self._node.destroy_subscription(self._answers)
        for publisher in self._publishers:
            self._node.destroy_publisher(publisher)

    def begin(self) -> None:
        """Count from now on, and what is exposed from now on alone."""
        self._since = self._node.get_clock().now()
        self.milliseconds.clear()

    def expose(self) -> None:
        """Send what is seen now, and take answers until the next exposure is due."""
        header = Header(frame_id="camera", stamp=self._node.get_clock().now().to_msg())
        messages = _messages(next(self._frames), header)
        for publisher, message in zip(self._publishers, messages, strict=True):
            publisher.publish(message)
        self._due = max(self._due + 1.0 / RATE, time.monotonic())
        self.listen(self._due)

    def listen(self, until: float) -> None:
        """Take answers up to a time of the monotonic clock, seconds."""
        while (left := until - time.monotonic()) > 0.0:
            self._executor.spin_once(timeout_sec=left)

    def _on_answer(self, message: MorphingParameters) -> None:
        exposed = Time.from_msg(message.header.stamp, self._since.clock_type)
        if exposed < self._since or message.status not in FOUND:
            return
        age = self._node.get_clock().now() - exposed
        self.milliseconds.append(age.nanoseconds * 1e-6)


def measure(node: Node, frames: int) -> dict[str, float]:
    """Let a morph_node in a process of its own answer a camera that rests before a door, at 30 Hz.

    Returns
    -------
    latency
        ``sent`` exposures, how many were ``answered`` by the door that they show, and ``median_ms``
        and ``p95_ms`` from before an exposure's images are made to messages until its parameters
        have come.

    Raises
    ------
    ProcessError
        If morph_node ends, or finds no door.
    """
    parameters = {**DOOR, "model": DoorSettings.load().model}
    arguments = ["-r", f"__ns:=/{NAMESPACE}"]
    for name, value in parameters.items():
        arguments += ["-p", f"{name}:={value}"]
    camera = _Camera(node)
    try:
        with (
            tempfile.TemporaryDirectory() as folder,
            NodeProcess(
                "kmn_perception", "morph_node", arguments, Path(folder) / "log"
            ) as answering,
        ):
            deadline = time.monotonic() + START_TIMEOUT
            while len(camera.milliseconds) < WARM_UP:
                camera.expose()
                answering.check()
                if time.monotonic() > deadline:
                    raise NoAnswerError(f"morph_node did not answer within {START_TIMEOUT:g} s")
            camera.begin()
            for _ in tqdm(range(frames), "latency", unit=" exposures", mininterval=1.0):
                camera.expose()
            camera.listen(time.monotonic() + LAST)
    finally:
        camera.close()
    if not (times := camera.milliseconds):
        raise NoAnswerError(f"morph_node told no door in any of {frames} exposures")
    return {
        "sent": frames,
        "answered": len(times),
        "median_ms": float(np.median(times)),
        "p95_ms": float(np.percentile(times, 95.0)),
    }


def _messages(seen: Seen, header: Header) -> Iterator[CameraInfo | Image]:
    """Yield the messages of an exposure; the depth, which is waited for, comes last."""
    assert seen.grey is not None
    info = info_from_camera(seen.camera, header)
    yield info
    yield info
    yield image_from_pixels(seen.grey, "mono8", header)
    yield image_from_depth(seen.depth, "16UC1", header)
