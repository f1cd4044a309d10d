"""morph_node finds doors in the walls of rendered rooms, and says what it cannot know."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from rclpy.parameter import Parameter

from door_rooms import DoorTalk, assert_true, given_pose, see_door
from kmn_msgs.msg import MorphingParameters
from kmn_perception.configuration.resources import find
from kmn_perception.model.rendering import depth_to_points
from kmn_perception.rooms.frame import make_frame
from kmn_perception.ros.messages import cloud_from_points
from kmn_perception.ros.morph_node import MorphNode

FLUSH, RECESSED = see_door(recess=0.0), see_door(recess=0.08)
NOT_FOUND = (MorphingParameters.NO_OBJECT, MorphingParameters.AMBIGUOUS)


@pytest.fixture(scope="module")
def node(graph: Any) -> MorphNode:
    values = {"model": "room_door", "reliability": "reliable", "image_delay": 1.0}
    values |= given_pose(FLUSH.camera)
    overrides = [Parameter(name, value=value) for name, value in values.items()]
    return graph.start(MorphNode, parameter_overrides=overrides)


@pytest.fixture(scope="module")
def talk(client: Any) -> DoorTalk:
    return DoorTalk(client)


def bodies(talk: DoorTalk, answer: MorphingParameters) -> int:
    return len(talk.client.overlay(answer.header.stamp)) - 1  # the first one deletes the others


def quantity(answer: MorphingParameters, name: str) -> tuple[float, float]:
    """Return a joint's position or a parameter of the surroundings, and its deviation."""
    names = [*answer.joint_names, *answer.surroundings_names]
    values = [*answer.joint_positions, *answer.surroundings]
    deviations = [*answer.joint_deviations, *answer.surroundings_deviations]
    return values[names.index(name)], deviations[names.index(name)]


def test_a_flush_door_is_found_by_its_edges_in_the_image(talk: DoorTalk) -> None:
    answer = talk.ask_grey(FLUSH)
    assert answer.status == MorphingParameters.OK, answer.reason
    assert (answer.model, answer.alternative, answer.mirrored) == ("room_door", "lever", False)
    assert_true(answer, FLUSH.door)
    for name in ("hinge", "recess"):
        value, deviation = quantity(answer, name)
        assert 0.0 < deviation < 0.02
        assert abs(value) < 3.0 * deviation
    assert bodies(talk, answer) == 3  # panel, grip and stem


def test_a_flush_door_is_not_observable_by_depth_alone(talk: DoorTalk) -> None:
    answer = talk.ask(FLUSH)
    assert answer.status == MorphingParameters.NO_OBJECT
    assert "a flush one is seen with an image only" in answer.reason
    assert not np.isfinite(answer.theta).any()
    assert bodies(talk, answer) == 0


def test_a_recessed_door_is_found_by_depth_alone_but_not_its_handle(talk: DoorTalk) -> None:
    answer = talk.ask(RECESSED)
    assert answer.status == MorphingParameters.HANDLE_NOT_SEEN
    assert "no handle is seen" in answer.reason
    assert answer.alternative == ""
    assert_true(answer, RECESSED.door, handle=False)
    recess, deviation = quantity(answer, "recess")
    assert abs(recess - 0.08) < 3.0 * deviation < 0.03
    handle = np.sqrt(np.diag(np.reshape(answer.covariance, (7, 7))))[5:]
    assert handle.min() > 0.05  # where to look, and that it is not known
    assert bodies(talk, answer) == 1  # the panel


def test_a_door_with_the_handle_at_the_left_is_mirrored(talk: DoorTalk) -> None:
    seen = see_door(recess=0.03, side="left")
    answer = talk.ask_grey(seen)
    assert answer.status == MorphingParameters.OK, answer.reason
    assert (answer.alternative, answer.mirrored) == ("lever", True)
    assert_true(answer, seen.door)
    assert np.linalg.det(answer.transform.reshape(4, 4)[:3, :3]) == pytest.approx(-1.0)
    # The handle that is drawn is where it is.
    grip = talk.client.overlay(answer.header.stamp)[2].pose.position
    camera = seen.camera.pose
    assert seen.door.handle_centre is not None
    truth = camera[:3, :3] @ seen.door.handle_centre + camera[:3, 3]
    np.testing.assert_allclose([grip.x, grip.y, grip.z], truth, atol=0.06)


@pytest.mark.parametrize(("side", "opening"), [("right", 0.3), ("left", 0.3), ("right", -0.3)])
def test_the_hinge_turns_as_in_the_model(talk: DoorTalk, side: str, opening: float) -> None:
    answer = talk.ask_grey(see_door(recess=0.0, side=side, opening=opening))
    assert (answer.alternative, answer.mirrored) == ("lever", side == "left")
    assert quantity(answer, "hinge")[0] == pytest.approx(opening, abs=0.03)


def test_an_open_door_without_its_handle_has_no_known_hinge(talk: DoorTalk) -> None:
    answer = talk.ask(see_door(recess=0.05, opening=0.3))
    assert answer.status in NOT_FOUND
    assert answer.reason


def test_no_handle_is_invented(talk: DoorTalk) -> None:
    answer = talk.ask_grey(see_door(recess=0.0, handle="none"))
    assert answer.status != MorphingParameters.OK
    assert answer.alternative == ""


def test_a_vertical_bar_is_no_lever(talk: DoorTalk) -> None:
    seen = see_door(recess=0.0, handle="bar")
    answer = talk.ask_grey(seen)
    assert answer.alternative in ("", "bar")
    if answer.status == MorphingParameters.OK:
        assert_true(answer, seen.door)


def test_a_kind_that_the_model_does_not_know_is_named(
    talk: DoorTalk, restored: None, tmp_path: Path
) -> None:
    known = yaml.safe_load(find("config/models", "room_door").read_text(encoding="utf-8"))
    del known["alternatives"]["handle"]["knob"]
    (tmp_path / "levers.yaml").write_text(yaml.safe_dump(known), encoding="utf-8")
    assert talk.client.set(model=str(tmp_path / "levers.yaml")).successful
    answer = talk.ask_grey(see_door(recess=0.0, handle="knob"))
    assert answer.status == MorphingParameters.HANDLE_NOT_SEEN
    assert "the handle is a knob" in answer.reason
    assert answer.alternative == ""


def test_the_world_may_be_that_of_the_floor_below_the_camera(
    talk: DoorTalk, restored: None
) -> None:
    assert talk.client.set(camera_pose="support_plane").successful
    seen = FLUSH
    below = seen.door.values - [seen.camera.pose[0, 3], 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]
    assert_true(talk.ask_grey(seen), replace(seen.door, values=below))


def test_a_door_is_found_in_an_organised_cloud(talk: DoorTalk) -> None:
    points = depth_to_points(RECESSED.depth, replace(RECESSED.camera, pose=np.eye(4)))
    answer = talk.client.ask(cloud_from_points(points, talk.header()))
    assert answer.status == MorphingParameters.HANDLE_NOT_SEEN
    assert_true(answer, RECESSED.door, handle=False)
    answer = talk.client.ask(cloud_from_points(points.reshape(-1, 3), talk.header()))
    assert answer.status == MorphingParameters.NO_OBJECT
    assert "expected a depth image or an organised cloud" in answer.reason


@pytest.mark.parametrize("kind", ["wall", "brick"])
def test_no_door_is_invented(talk: DoorTalk, restored: None, kind: str) -> None:
    frame = make_frame(1, "none", kind)
    assert talk.client.set(**given_pose(frame.room.camera)).successful
    seen = FLUSH._replace(depth=frame.depth, grey=frame.images.grey, camera=frame.room.camera)
    answer = talk.ask_grey(seen)
    assert answer.status in NOT_FOUND
    assert answer.reason


def test_weights_of_another_network_are_refused(talk: DoorTalk) -> None:
    result = talk.client.set(weights="door")
    assert not result.successful
    assert "not one that proposes doors in walls" in result.reason
