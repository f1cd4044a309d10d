"""The bag of real Kinect frames."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import CameraInfo, Image, PointCloud2

from kmn_perception.bags.example_bag import TYPES, make_example_bag
from kmn_perception.bags.rosbag2 import read_messages, read_topics

PICTURES = Path(__file__).parents[1] / "data" / "kinect_boxes"


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("example") / "bag"
    make_example_bag(path, rate=4.0)
    return path


def _millimetres(number: int) -> NDArray[np.uint16]:
    picture = cv2.imread(str(PICTURES / f"learn{number}_d.png"), cv2.IMREAD_UNCHANGED)
    assert picture is not None
    return picture.astype(np.uint16)


def test_it_holds_seventeen_frames_of_each_topic_at_the_asked_rate(bag: Path) -> None:
    topics = read_topics(bag)
    assert {name: topic.type for name, topic in topics.items()} == TYPES
    for name in topics:
        stamps = [message.stamp for message in read_messages(bag, [name])]
        assert np.diff(stamps).tolist() == [250_000_000] * 16


def test_the_depth_images_are_the_shipped_pictures_in_their_order(bag: Path) -> None:
    for number, message in enumerate(read_messages(bag, ["/depth/image"])):
        image = deserialize_message(message.data, Image)
        assert image.encoding == "16UC1"
        assert image.header.frame_id == "camera_optical_frame"
        assert image.header.stamp.sec * 10**9 + image.header.stamp.nanosec == message.stamp
        pixels = np.frombuffer(image.data, "<u2").reshape(image.height, image.width)
        np.testing.assert_array_equal(pixels, _millimetres(number))


def test_the_clouds_are_the_depth_images_seen_through_the_camera(bag: Path) -> None:
    info = deserialize_message(next(read_messages(bag, ["/depth/camera_info"])).data, CameraInfo)
    assert info.k.tolist() == [525.0, 0.0, 319.5, 0.0, 525.0, 239.5, 0.0, 0.0, 1.0]
    for number, message in enumerate(read_messages(bag, ["/points"])):
        cloud = deserialize_message(message.data, PointCloud2)
        assert (cloud.height, cloud.width, cloud.is_dense) == (480, 640, False)
        assert [field.name for field in cloud.fields] == ["x", "y", "z"]
        points = np.frombuffer(cloud.data, "<f4").reshape(480, 640, 3)
        measured = _millimetres(number) > 0
        assert np.isnan(points[~measured]).all()
        # Seen through the same camera, each point falls back onto its pixel.
        u, v = np.meshgrid(np.arange(640), np.arange(480))
        x, y, z = points[measured].T
        np.testing.assert_allclose(525.0 * x / z + 319.5, u[measured], atol=1e-3)
        np.testing.assert_allclose(525.0 * y / z + 239.5, v[measured], atol=1e-3)
        np.testing.assert_allclose(1e3 * z, _millimetres(number)[measured], atol=1e-3)
