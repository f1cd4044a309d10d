"""Images beside the depth: which one belongs to a frame, and what becomes of bad ones."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from rclpy.parameter import Parameter
from sensor_msgs.msg import CameraInfo, Image
from std_msgs.msg import Header

from door_rooms import DoorTalk, assert_true, given_pose, image_from_grey, see_door
from kmn_msgs.msg import MorphingParameters
from kmn_perception.model.camera import Camera
from kmn_perception.ros.messages import info_from_camera
from kmn_perception.ros.morph_node import MorphNode

SEEN = see_door(recess=0.0)
COLOURED = np.stack([SEEN.grey] * 3, axis=-1)
LENS = (0.08, -0.05, 0.001, -0.002, 0.01)  # plumb_bob


@pytest.fixture(scope="module")
def node(graph: Any) -> MorphNode:
    values = {"model": "room_door", "reliability": "reliable", "image_delay": 0.3}
    values |= given_pose(SEEN.camera)
    overrides = [Parameter(name, value=value) for name, value in values.items()]
    return graph.start(MorphNode, parameter_overrides=overrides)


@pytest.fixture(scope="module")
def talk(client: Any) -> DoorTalk:
    return DoorTalk(client)


def through_lens(grey: NDArray[np.uint8], seen_by: Camera, raw: Camera) -> NDArray[np.uint8]:
    """Return the raw image of a camera with a lens, of what a pinhole camera saw."""
    v, u = np.indices((raw.height, raw.width), dtype=np.float64)
    pixels = np.stack([u.ravel(), v.ravel()], axis=-1)[:, None]
    ideal = cv2.undistortPoints(pixels, raw.matrix, np.array(LENS), P=seen_by.matrix)
    places = ideal.reshape(raw.height, raw.width, 2).astype(np.float32)
    seen = cv2.remap(
        grey, places[..., 0], places[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
    )
    return seen.astype(np.uint8)


@pytest.mark.parametrize("encoding", ["rgb8", "bgr8"])
def test_colours_serve_as_grey_values(talk: DoorTalk, encoding: str) -> None:
    header = talk.header()
    answer = talk.ask(SEEN, image_from_grey(COLOURED, header, encoding=encoding), header)
    assert answer.status == MorphingParameters.OK, answer.reason
    assert_true(answer, SEEN.door)


def test_an_image_that_comes_after_its_depth_is_waited_for(talk: DoorTalk, restored: None) -> None:
    assert talk.client.set(image_delay=1.0).successful
    header = talk.header()
    image = image_from_grey(SEEN.grey, header)
    threading.Timer(0.2, talk.image.publish, [image]).start()
    assert talk.ask(SEEN, header=header).status == MorphingParameters.OK


def test_an_image_late_by_half_a_second_is_not_used(talk: DoorTalk) -> None:
    for _ in range(2):
        header = talk.header()
        answer = talk.ask(SEEN, image_from_grey(SEEN.grey, header, late=0.5), header)
        assert answer.status == MorphingParameters.NO_OBJECT
        assert "a flush one is seen with an image only" in answer.reason
        assert "0.50 s older than the depth" in answer.reason
    assert int(talk.client.report()["images_late"]) >= 2
    told = [line for line in talk.client.log if "no stamps within image_delay" in line]
    assert len(told) == 1


def truncated(header: Header) -> Image:
    image = image_from_grey(SEEN.grey, header)
    image.data = image.data[:-1]
    return image


BAD: dict[str, tuple[Callable[[Header], Image], str]] = {
    "image_size": (
        lambda header: image_from_grey(SEEN.grey[::2, ::2].copy(), header),
        "the image has 320 x 240 pixels, the depth 640 x 480",
    ),
    "image_encoding": (
        lambda header: image_from_grey(SEEN.grey, header, encoding="mono16"),
        "the image has encoding 'mono16', expected mono8, rgb8, bgr8",
    ),
    "row_step": (
        lambda header: image_from_grey(SEEN.grey, header, encoding="rgb8"),
        "the image's step is 640, expected 1920",
    ),
    "truncated": (truncated, "bytes of data, expected"),
}


@pytest.mark.parametrize("key", BAD)
def test_a_bad_image_is_refused_and_the_depth_estimated_alone(talk: DoorTalk, key: str) -> None:
    make, text = BAD[key]
    recessed = see_door(recess=0.08)
    header = talk.header()
    answer = talk.ask(recessed, make(header), header)
    assert answer.status == MorphingParameters.HANDLE_NOT_SEEN
    assert_true(answer, recessed.door, handle=False)
    assert text in answer.reason
    assert talk.client.report()[f"images_refused_{key}"] == "1"
    assert talk.ask_grey(SEEN).status == MorphingParameters.OK  # the node goes on


def test_images_are_left_alone_on_request(talk: DoorTalk, restored: None) -> None:
    assert talk.client.set(use_image=False).successful
    talk.client.graph.wait_for(lambda: talk.image.get_subscription_count() == 0)
    assert talk.ask_grey(SEEN).status == MorphingParameters.NO_OBJECT
    assert talk.client.set(use_image=True).successful
    talk.client.graph.wait_for(talk.image.get_subscription_count)
    assert talk.ask_grey(SEEN).status == MorphingParameters.OK


def test_an_image_of_another_lens_is_resampled(talk: DoorTalk) -> None:
    """Last in this file: from now on images have a description."""
    wide = Camera.load("d455").resized(1280, 960)
    raw = replace(wide, width=1240, height=930, cx=wide.cx - 15.0, cy=wide.cy - 10.0)
    grey = through_lens(see_door(recess=0.0, camera=wide).grey, wide, raw)
    info = talk.client.create_publisher(CameraInfo, "image/camera_info", 10)
    talk.client.graph.wait_for(info.get_subscription_count)

    def ask(described: CameraInfo) -> MorphingParameters:
        header = talk.header()
        described.header = header
        info.publish(described)
        info.wait_for_all_acked()
        return talk.ask(SEEN, image_from_grey(grey, header), header)

    described = info_from_camera(raw, Header())
    described.d = list(LENS)
    answer = ask(described)
    assert answer.status == MorphingParameters.OK, answer.reason
    assert_true(answer, SEEN.door)
    answer = ask(info_from_camera(wide, Header()))
    assert "the image has 1240 x 930 pixels, its camera_info 1280 x 960" in answer.reason
    described.distortion_model = "fisheye"
    assert "'fisheye' is not known" in ask(described).reason
