"""What is said of the camera before a door, against what it sees."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from rclpy.parameter import Parameter

from door_rooms import DoorTalk, assert_true, given_pose, see_door
from kmn_msgs.msg import MorphingParameters
from kmn_perception.ros.morph_node import MorphNode

SEEN = see_door(recess=0.08)


@pytest.fixture(scope="module")
def node(graph: Any) -> MorphNode:
    values = {"model": "room_door", "reliability": "reliable", "image_delay": 1.0}
    overrides = [Parameter(name, value=value) for name, value in values.items()]
    return graph.start(MorphNode, parameter_overrides=overrides)


@pytest.fixture
def talk(client: Any, restored: None) -> DoorTalk:
    return DoorTalk(client)


def test_a_camera_upside_down_is_believed_if_its_pose_says_so(talk: DoorTalk) -> None:
    turned = SEEN.upside_down()
    assert talk.client.set(**given_pose(turned.camera)).successful
    answer = talk.ask_grey(turned)
    assert answer.status == MorphingParameters.OK, answer.reason
    assert_true(answer, SEEN.door)


@pytest.mark.parametrize("pose", [given_pose(SEEN.camera), {"camera_pose": "support_plane"}])
def test_else_there_is_no_door(talk: DoorTalk, pose: dict[str, Any]) -> None:
    assert talk.client.set(**pose).successful
    for ask in (talk.ask, talk.ask_grey):
        answer = ask(SEEN.upside_down())
        assert answer.status == MorphingParameters.NO_OBJECT
        assert answer.reason
    if "camera_quaternion" not in pose:
        assert "the camera upside down" in answer.reason


def test_a_wrong_height_is_refused_with_both_heights(talk: DoorTalk) -> None:
    pose = SEEN.camera.pose.copy()
    pose[2, 3] = 1.7
    assert talk.client.set(**given_pose(replace(SEEN.camera, pose=pose))).successful
    answer = talk.ask_grey(SEEN)
    assert answer.status == MorphingParameters.NO_OBJECT
    assert "1.30 m below the camera" in answer.reason
    assert "1.70 m" in answer.reason


def test_a_pose_below_the_floor_is_refused(talk: DoorTalk) -> None:
    pose = SEEN.camera.pose.copy()
    pose[2, 3] = -0.4
    assert talk.client.set(**given_pose(replace(SEEN.camera, pose=pose))).successful
    assert "-0.40 m above the floor" in talk.ask(SEEN).reason


def test_without_a_floor_in_view_the_pose_tells_its_height(talk: DoorTalk) -> None:
    seen = see_door(recess=0.08, theta=(-1.2, 0.0, 0.1), tilt=0.3)
    assert talk.client.set(**given_pose(seen.camera)).successful
    answer = talk.ask_grey(seen)
    assert answer.status == MorphingParameters.OK, answer.reason
    assert_true(answer, seen.door)


def test_without_floor_and_pose_the_handle_s_height_is_open(talk: DoorTalk) -> None:
    seen = see_door(recess=0.08, theta=(-1.2, 0.0, 0.1), tilt=0.3)
    assert talk.client.set(camera_pose="support_plane").successful
    answer = talk.ask(seen)
    deviation = np.sqrt(answer.covariance[48])
    assert answer.status != MorphingParameters.OK
    assert np.isnan(deviation) or deviation > 0.05


def test_an_error_of_the_sensor_is_named_in_diagnostics(talk: DoorTalk) -> None:
    assert talk.client.set(camera_pose="support_plane").successful
    off = SEEN._replace(depth=(1.0 / (1.0 / SEEN.depth - 0.06)).astype(np.float32))
    talk.ask_grey(off)
    assert "depth is too large by about" in talk.client.report()["calibration"]
    talk.ask_grey(SEEN)
    assert "calibration" not in talk.client.report()
