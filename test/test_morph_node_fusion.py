"""morph_node fuses the frames of a camera that rests, or whose pose is given."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from rclpy.parameter import Parameter

from door_rooms import DoorTalk, Seen, assert_true, given_pose, see_door
from kmn_msgs.msg import MorphingParameters
from kmn_msgs.srv import EstimateMorphing
from kmn_perception.model.depth_sensor import DepthSensor
from kmn_perception.model.noisy_sensor import NoisySensor
from kmn_perception.model.rendering import depth_to_points
from kmn_perception.ros.messages import cloud_from_points
from kmn_perception.ros.morph_node import MorphNode

RECESSED, LEFT = see_door(recess=0.08), see_door(recess=0.08, side="left")
GREY_NOISE = 2.0  # of 255
FRAMES = 8


@pytest.fixture(scope="module")
def node(graph: Any) -> MorphNode:
    values = {"model": "room_door", "reliability": "reliable", "image_delay": 1.0}
    values |= {"calibration": "calibrated", "fused_frames": 30} | given_pose(RECESSED.camera)
    overrides = [Parameter(name, value=value) for name, value in values.items()]
    return graph.start(MorphNode, parameter_overrides=overrides)


@pytest.fixture(scope="module")
def talk(client: Any) -> DoorTalk:
    return DoorTalk(client)


def with_noise(seen: Seen, seed: int) -> Seen:
    generator = np.random.default_rng(seed)
    depth = NoisySensor(DepthSensor.load("d455"), seed).measure(seen.depth, seen.camera.fx)
    grey = seen.grey + GREY_NOISE * generator.standard_normal(seen.grey.shape)
    return seen._replace(depth=depth, grey=np.clip(np.rint(grey), 0, 255).astype(np.uint8))


def ask_all(talk: DoorTalk, seen: Seen) -> list[MorphingParameters]:
    return [talk.ask_grey(with_noise(seen, seed)) for seed in range(FRAMES)]


def volume(answer: MorphingParameters) -> float:
    """Return the logarithm of the determinant of the covariance."""
    return float(np.linalg.slogdet(np.reshape(answer.covariance, (7, 7)))[1])


@pytest.mark.parametrize("camera_pose", ["given", "support_plane"])
def test_more_is_known_after_several_frames(
    talk: DoorTalk, restored: None, camera_pose: str
) -> None:
    assert talk.client.set(camera_pose=camera_pose).successful
    answers = ask_all(talk, RECESSED)
    assert {answer.status for answer in answers} == {MorphingParameters.OK}
    assert talk.client.set(fused_frames=1).successful
    alone = ask_all(talk, RECESSED)
    assert volume(answers[0]) == pytest.approx(volume(alone[0]))
    assert volume(answers[-1]) < np.mean([volume(answer) for answer in alone])
    late, late_alone = (np.ptp([one.theta[2] for one in asked[-4:]]) for asked in (answers, alone))
    assert late < 0.5 * late_alone  # what is known changes less than what single frames say
    door = RECESSED.door
    if camera_pose == "support_plane":  # the world's origin is below the camera
        values = door.values.copy()
        values[0] -= RECESSED.camera.pose[0, 3]
        door = replace(door, values=values)
    assert_true(answers[-1], door)


def test_another_door_is_a_rival_until_the_parameters_change(
    talk: DoorTalk, restored: None
) -> None:
    ask_all(talk, RECESSED)
    same_pose = given_pose(RECESSED.camera)
    for values in ({}, {"camera_position": same_pose["camera_position"]}):
        assert not values or talk.client.set(**values).successful
        answer = talk.ask_grey(LEFT)
        assert answer.status == MorphingParameters.AMBIGUOUS
        assert "another one" in answer.reason
    assert talk.client.set(fused_frames=20).successful
    assert talk.ask_grey(LEFT).mirrored
    assert talk.client.set(fused_frames=1).successful
    assert not talk.ask_grey(RECESSED).mirrored


def test_the_service_answers_each_cloud_by_itself(talk: DoorTalk) -> None:
    points = depth_to_points(RECESSED.depth, replace(RECESSED.camera, pose=np.eye(4)))
    cloud = cloud_from_points(points, talk.header())
    talk.client.ask(cloud)
    request = EstimateMorphing.Request(points=cloud_from_points(points, talk.header()))
    before = talk.client.call(talk.client.estimation, request).parameters
    ask_all(talk, LEFT)
    after = talk.client.call(talk.client.estimation, request).parameters
    assert before.status == after.status == MorphingParameters.HANDLE_NOT_SEEN
    np.testing.assert_array_equal(before.covariance, after.covariance)
