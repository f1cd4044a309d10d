"""morph_node tells from real frames that its sensor is described wrongly."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from numpy.typing import NDArray
from std_msgs.msg import Header

from kmn_perception.bags.example_bag import load_frames
from kmn_perception.model.camera import Camera
from kmn_perception.model.rendering import depth_to_points
from kmn_perception.ros.messages import cloud_from_points, image_from_depth, info_from_camera

KINECT = Camera.load("kinect_v1")
DEPTH = load_frames()[0]
POINTS = depth_to_points(DEPTH, KINECT)
WIDE = replace(KINECT.resized(320, 240), width=640, height=480)


@pytest.fixture(scope="module")
def sensor(client: Any) -> list[DiagnosticStatus]:
    """Return what /diagnostics says about the sensor, newest last."""
    reports: list[DiagnosticStatus] = []

    def keep(report: DiagnosticArray) -> None:
        reports.extend(status for status in report.status if status.name.endswith(": sensor"))

    client.create_subscription(DiagnosticArray, "/diagnostics", keep, 10)
    return reports


def _header(client: Any) -> Header:
    return Header(stamp=client.get_clock().now().to_msg(), frame_id="camera_optical_frame")


def _send(client: Any, points: NDArray[np.float32]) -> None:
    client.ask(cloud_from_points(points, _header(client)))


def _wait_for(client: Any, sensor: list[DiagnosticStatus], key: str) -> DiagnosticStatus:
    return client.graph.wait_for(
        lambda: next((s for s in sensor if key in [v.key for v in s.values]), None)
    )


BODY = np.array([[0, 0, 1], [-1, 0, 0], [0, -1, 0]], dtype=np.float32)
BROKEN = {
    "body_frame": (POINTS @ BODY.T, "x forward, y left, z up"),
    "flipped_z": (POINTS * np.array([1, 1, -1], dtype=np.float32), "z is flipped"),
    "metres_as_millimetres": (POINTS / 1000, "metres taken for millimetres"),
    "other_resolution": (depth_to_points(DEPTH, WIDE), "of another resolution"),
    "other_origin": (POINTS + np.array([0.025, 0, 0], dtype=np.float32), "by another camera"),
}


@pytest.mark.parametrize("key", BROKEN)
def test_a_wrong_cloud_is_diagnosed_in_plain_words(
    client: Any, sensor: list[DiagnosticStatus], key: str
) -> None:
    points, text = BROKEN[key]
    sensor.clear()
    while not any(value.key == key for status in sensor for value in status.values):
        _send(client, points.astype(np.float32))
    assert sensor[-1].level == DiagnosticStatus.WARN
    assert text in _wait_for(client, sensor, key).message
    client.graph.wait_for(lambda: any(text in line for line in client.log))


def test_a_wrong_camera_info_is_diagnosed(client: Any, sensor: list[DiagnosticStatus]) -> None:
    sensor.clear()
    while not sensor or not sensor[-1].values or sensor[-1].values[0].key != "other_resolution":
        header = _header(client)
        client.ask_depth(image_from_depth(DEPTH, "16UC1", header), info_from_camera(WIDE, header))
    assert "in that of one of 320 x 240" in sensor[-1].message


def test_millimetres_are_refused_with_what_they_are(client: Any) -> None:
    answer = client.ask(cloud_from_points(1000 * POINTS, _header(client)))
    assert "if these are millimetres, divide by 1000" in answer.reason


def test_a_negative_depth_image_is_refused_with_what_it_is(client: Any) -> None:
    header = _header(client)
    image = image_from_depth(-DEPTH, "32FC1", header)
    answer = client.ask_depth(image, info_from_camera(KINECT, header))
    assert "z is flipped" in answer.reason


def test_good_frames_give_no_alarm(client: Any, sensor: list[DiagnosticStatus]) -> None:
    for depth in load_frames():
        _send(client, depth_to_points(depth, KINECT))
    sensor.clear()
    while len(sensor) < 3:
        _send(client, POINTS)
    assert sensor[-1].level == DiagnosticStatus.OK
    assert sensor[-1].message == "nothing wrong was recognised"
