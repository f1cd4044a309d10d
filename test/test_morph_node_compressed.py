"""morph_node on images that image_transport has compressed, whose raw topics are remapped."""

from __future__ import annotations

import array
import struct
from typing import Any

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from rclpy.parameter import Parameter
from sensor_msgs.msg import CameraInfo, CompressedImage
from std_msgs.msg import Header

from door_rooms import SECONDS, assert_true, given_pose, see_door
from graph import GraphClient
from kmn_msgs.msg import MorphingParameters
from kmn_perception.ros.messages import info_from_camera
from kmn_perception.ros.morph_node import MorphNode

SEEN = see_door(recess=0.0)
CONFIG = struct.pack("<i2f", 0, 0.0, 0.0)
DEPTH = "/camera/depth/image_raw/compressedDepth"
COLOUR = "/camera/color/image_raw/compressed"


def file(ending: str, pixels: NDArray[Any]) -> bytes:
    """Return the bytes of an image file."""
    written, data = cv2.imencode(ending, pixels)
    assert written
    return data.tobytes()


MILLIMETRES = np.nan_to_num(np.rint(SEEN.depth * 1000.0)).astype(np.uint16)
DEPTH_DATA = CONFIG + file(".png", MILLIMETRES)
JPEG = file(".jpg", np.stack([SEEN.grey] * 3, axis=-1))


class Talk(GraphClient):
    """Publishes what a camera does with its transports, and keeps the answers."""

    def __init__(self, graph: Any) -> None:
        super().__init__(graph, "morph_node")
        self.answers: list[MorphingParameters] = []
        self.create_subscription(
            MorphingParameters, "morphing_parameters", self.answers.append, 100
        )
        self.depth = self.create_publisher(CompressedImage, DEPTH, 10)
        self.info = self.create_publisher(CameraInfo, "depth/camera_info", 10)
        self.image = self.create_publisher(CompressedImage, COLOUR, 10)

    def ask(self, depth: bytes = DEPTH_DATA, image: bytes = JPEG) -> MorphingParameters:
        """Publish an image and depth; return the answer."""
        header = Header(frame_id="camera_optical_frame")
        header.stamp.sec = next(SECONDS)
        info = info_from_camera(SEEN.camera, header)
        data, kind = array.array("B", image), "rgb8; jpeg compressed bgr8"
        self.image.publish(CompressedImage(header=header, format=kind, data=data))
        self.info.publish(info)
        for publisher in (self.image, self.info):
            publisher.wait_for_all_acked()
        data, kind = array.array("B", depth), "16UC1; compressedDepth png"
        self.depth.publish(CompressedImage(header=header, format=kind, data=data))
        return self.graph.wait_for(
            lambda: next((a for a in self.answers if a.header.stamp == header.stamp), None)
        )


@pytest.fixture(scope="module")
def talk(graph: Any) -> Talk:
    values = {"model": "room_door", "reliability": "reliable", "image_delay": 0.3}
    values |= {"depth_image_transport": "compressedDepth", "image_transport": "compressed"}
    values |= given_pose(SEEN.camera)
    remapped = [
        "-r",
        "depth/image:=/camera/depth/image_raw",
        "-r",
        "image:=/camera/color/image_raw",
    ]
    graph.start(
        MorphNode,
        cli_args=["--ros-args", *remapped],
        parameter_overrides=[Parameter(name, value=value) for name, value in values.items()],
    )
    made = graph.start(lambda **_: Talk(graph))
    for publisher in (made.depth, made.info, made.image):
        graph.wait_for(publisher.get_subscription_count)
    graph.wait_for(lambda: made.reports)
    return made


def test_a_flush_door_is_found_in_compressed_images(talk: Talk) -> None:
    answer = talk.ask()
    assert answer.status == MorphingParameters.OK, answer.reason
    assert_true(answer, SEEN.door)
    assert int(talk.report()["images_used"]) >= 1


def test_broken_depth_is_refused_with_an_answer_and_the_node_goes_on(talk: Talk) -> None:
    answer = talk.ask(depth=DEPTH_DATA[:-100])
    assert answer.status == MorphingParameters.NO_OBJECT
    assert "of the compressed depth image are damaged" in answer.reason
    assert talk.report()["refused_compressed_data"] == "1"
    assert talk.ask().status == MorphingParameters.OK


def test_a_broken_image_is_not_used(talk: Talk) -> None:
    answer = talk.ask(image=JPEG[: len(JPEG) // 3])
    assert answer.status == MorphingParameters.NO_OBJECT
    assert "the compressed image are damaged" in answer.reason
    assert talk.report()["images_refused_compressed_data"] == "1"
    assert talk.ask().status == MorphingParameters.OK


def test_nothing_else_is_subscribed_to(talk: Talk) -> None:
    """Else a camera would compress, and send, for nothing."""
    for topic in ("/camera/depth/image_raw", "/camera/color/image_raw"):
        assert talk.count_subscribers(topic) == 0
