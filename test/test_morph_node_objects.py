"""morph_node on real Kinect frames, with all of their objects."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
import pytest
from std_msgs.msg import Header
from visualization_msgs.msg import Marker

from kmn_msgs.msg import MorphingParameters
from kmn_msgs.srv import EstimateMorphing
from kmn_perception.bags.example_bag import load_frames
from kmn_perception.configuration.resources import share_directory
from kmn_perception.model.camera import Camera
from kmn_perception.model.rendering import depth_to_points
from kmn_perception.ros.messages import cloud_from_points
from kmn_perception.ros.morph_node import MorphNode

CAMERA = Camera.load("kinect_v1")
FRAMES = load_frames()
NOISE = 0.0005  # metres


@pytest.fixture(scope="module")
def node(graph: Any) -> MorphNode:
    arguments = ["--ros-args", "--params-file"]
    arguments += [str(share_directory() / "config/nodes/morph_node_tabletop.yaml")]
    arguments += ["-p", "reliability:=reliable", "-p", "objects:=all"]
    return graph.start(MorphNode, cli_args=arguments)


def cartons(number: int) -> int:
    """Return how many cartons are labelled in a frame."""
    file = share_directory() / f"data/kinect_boxes/learn{number}_l.png"
    labels: Any = cv2.imread(str(file), cv2.IMREAD_UNCHANGED)
    return len(set(np.unique(labels)) - {0, 1})


def cloud(number: int, seconds: int, noise: float = 0.0) -> Any:
    header = Header(frame_id="camera_optical_frame")
    header.stamp.sec = seconds
    random = np.random.default_rng(seconds)
    depth = FRAMES[number] + noise * random.standard_normal(FRAMES[number].shape)
    return cloud_from_points(depth_to_points(depth.astype(np.float32), CAMERA), header)


def ask_all(client: Any, message: Any, count: int) -> list[MorphingParameters]:
    """Return the answers to a cloud, of which there are so many."""
    client.points.publish(message)
    stamp = message.header.stamp
    client.overlay(stamp)  # comes after all answers
    return list(
        client.graph.wait_for(
            lambda: (
                found
                if len(found := [a for a in client.answers if a.header.stamp == stamp]) >= count
                else None
            )
        )
    )


@pytest.mark.parametrize("number", [0, 10, 13, 16])
def test_every_carton_has_a_message_a_marker_and_a_number_that_stays(
    client: Any, number: int
) -> None:
    count = cartons(number)
    places: list[dict[int, Any]] = []
    for repetition in range(3):
        message = cloud(number, 100 * (number + 1) + repetition, NOISE)
        answers = ask_all(client, message, count)
        assert len(answers) == count
        assert {a.status for a in answers} == {MorphingParameters.OK}
        assert not any(a.truncated for a in answers)
        places.append({a.id: a.theta[:2] for a in answers})
        markers = [m for m in client.overlay(message.header.stamp) if m.action == Marker.ADD]
        drawn = [(m.pose.position.x, m.pose.position.y) for m in markers]
        np.testing.assert_allclose(drawn, [a.theta[:2] for a in answers], atol=1e-9)
        assert len({m.id for m in markers}) == count
    assert len(places[0]) == count and min(places[0]) >= 1
    for later in places[1:]:
        assert later.keys() == places[0].keys()
        for number_of_object, place in later.items():
            np.testing.assert_allclose(place, places[0][number_of_object], atol=0.01)
    report = client.report()
    assert int(report["objects_last"]) == count


def test_without_an_object_one_message_says_why(client: Any) -> None:
    header = Header(frame_id="camera_optical_frame")
    header.stamp.sec = 5000
    depth = FRAMES[0].copy()
    file = share_directory() / "data/kinect_boxes/learn0_l.png"
    labels: Any = cv2.imread(str(file), cv2.IMREAD_UNCHANGED)
    depth[labels > 1] = np.nan
    (answer,) = ask_all(client, cloud_from_points(depth_to_points(depth, CAMERA), header), 1)
    assert (answer.status, answer.id) == (MorphingParameters.NO_OBJECT, 0)
    assert answer.reason == "no points of an object"
    assert client.report()["objects_last"] == "0"


def test_an_object_at_the_border_is_called_cut(client: Any) -> None:
    header = Header(frame_id="camera_optical_frame")
    header.stamp.sec = 6000
    file = share_directory() / "data/kinect_boxes/learn0_l.png"
    labels: Any = cv2.imread(str(file), cv2.IMREAD_UNCHANGED)
    middle = int(np.median(np.nonzero(labels == 20)[1]))
    points = depth_to_points(FRAMES[0], CAMERA)[:, :middle]
    answers = ask_all(client, cloud_from_points(np.ascontiguousarray(points), header), 2)
    nearest = min(answers, key=lambda a: a.theta[1])
    assert nearest.truncated
    covariance = np.reshape(nearest.covariance, (6, 6))
    assert 0.2 * np.sqrt(np.diag(covariance))[3:].max() > 0.02  # metres; how long is not seen


def test_what_the_budget_leaves_out_has_messages_and_a_count(client: Any) -> None:
    count = cartons(13)
    before = int(client.report()["objects_left_out"])
    assert client.set(max_objects=1).successful
    answers = ask_all(client, cloud(13, 6500), count)
    assert client.set(max_objects=50).successful
    assert sorted(a.status for a in answers) == [
        MorphingParameters.OK, *[MorphingParameters.NOT_CONVERGED] * (count - 1)
    ]  # fmt: skip
    left_out = [a.reason for a in answers if a.reason]
    assert all(r.startswith(f"left out: 1 of {count} objects were") for r in left_out)
    report = client.report()
    assert int(report["objects_left_out"]) == before + count - 1
    assert f"({count - 1} times)" in report["last"]


def test_nearest_is_a_single_object_without_a_number(client: Any) -> None:
    response = client.call(client.estimation, EstimateMorphing.Request(points=cloud(13, 7000)))
    assert (response.parameters.status, response.parameters.id) == (MorphingParameters.OK, 0)
    assert client.set(objects="nearest").successful
    (answer,) = ask_all(client, cloud(13, 7001), 1)
    assert (answer.status, answer.id) == (MorphingParameters.OK, 0)
    np.testing.assert_allclose(answer.theta, response.parameters.theta, atol=1e-9)
    refused = client.set(objects="some")
    assert not refused.successful
    assert "'objects' must be one of nearest, all" in refused.reason
    assert client.set(objects="all").successful
