"""morph_node on the real Kinect frames, as configured for boxes on a table."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
import pytest
from std_msgs.msg import Header

from kmn_msgs.msg import MorphingParameters
from kmn_perception.bags.example_bag import load_frames
from kmn_perception.configuration.resources import share_directory
from kmn_perception.model.camera import Camera
from kmn_perception.model.rendering import depth_to_points
from kmn_perception.ros.messages import cloud_from_points, image_from_depth, info_from_camera
from kmn_perception.ros.morph_node import MorphNode

CAMERA = Camera.load("kinect_v1")
FRAMES = load_frames()


def header(seconds: int) -> Header:
    made = Header(frame_id="camera_optical_frame")
    made.stamp.sec = seconds
    return made


@pytest.fixture(scope="module")
def node(graph: Any) -> MorphNode:
    arguments = ["--ros-args", "--params-file"]
    arguments += [str(share_directory() / "config/nodes/morph_node_tabletop.yaml")]
    arguments += ["-p", "reliability:=reliable"]
    return graph.start(MorphNode, cli_args=arguments)


def test_images_wait_for_the_first_camera_info_or_are_refused_with_an_answer(client: Any) -> None:
    early = [image_from_depth(FRAMES[0], "16UC1", header(seconds)) for seconds in (1, 2)]
    for image in early:
        client.image.publish(image)
        answer = client.answer(image.header.stamp)
        assert answer.status == MorphingParameters.NO_OBJECT
        assert "depth/image came without depth/camera_info" in answer.reason
    assert client.report()["refused_no_camera_info"] == "2"
    assert any("depth/image came without depth/camera_info" in line for line in client.log)
    third = image_from_depth(FRAMES[0], "16UC1", header(3))
    client.image.publish(third)
    client.image.wait_for_all_acked()
    client.info.publish(info_from_camera(CAMERA, header(3)))
    assert client.answer(third.header.stamp).points_used > 1000


@pytest.mark.parametrize("number", range(len(FRAMES)))
def test_one_carton_of_a_real_frame_is_estimated(client: Any, number: int) -> None:
    labels: Any = cv2.imread(
        str(share_directory() / f"data/kinect_boxes/learn{number}_l.png"), cv2.IMREAD_UNCHANGED
    )
    measured = np.isfinite(FRAMES[number])
    cartons = [(measured & (labels == label)).sum() for label in (20, 30, 40)]
    image = image_from_depth(FRAMES[number], "16UC1", header(100 + 2 * number))
    answer = client.ask_depth(image, info_from_camera(CAMERA, image.header))
    assert answer.status == MorphingParameters.OK, answer.reason
    assert min(abs(answer.points_used / size - 1.0) for size in cartons if size) < 0.05
    cloud = cloud_from_points(depth_to_points(FRAMES[number], CAMERA), header(101 + 2 * number))
    np.testing.assert_allclose(client.ask(cloud).theta, answer.theta, atol=1e-3)
