"""morph_node takes the pose of a camera that moves from transforms, or tells why it cannot."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from itertools import count
from typing import Any

import numpy as np
import pytest
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import PointCloud2
from tf2_msgs.msg import TFMessage

from kmn_msgs.msg import MorphingParameters
from kmn_msgs.srv import EstimateMorphing
from kmn_perception.model.rotation import matrix_from_quaternion
from kmn_perception.ros.morph_node import MorphNode
from kmn_perception.ros.node_process import namespace_arguments
from transform_talk import (
    BOXES,
    FRAME,
    MODEL,
    ON_BASE,
    Broadcaster,
    base_at,
    pose_2d,
    seen_from,
    told,
)

TIMES = count(100, 20)  # of the tests, seconds; each has its own past
STEP = 0.25  # seconds between two transforms


@pytest.fixture(scope="module")
def node(graph: Any) -> MorphNode:
    values = {
        "model": "box",
        "reliability": "reliable",
        "objects": "all",
        "iterations": 10,
        "cluster_step": 0.02,
        "crop_max": [1.5, 1.5, 0.8],
    }
    overrides = [Parameter(name, value=value) for name, value in values.items()]
    return graph.start(MorphNode, parameter_overrides=overrides)


@pytest.fixture(scope="module")
def broadcaster(client: Any) -> Broadcaster:
    made = Broadcaster(client)
    made.fix(told("base", FRAME, 0.0, ON_BASE))
    (answer,) = answers(client, seen_from(base_at(0.0), 1.0)).values()  # from now on it listens
    assert "no transform names the frame 'world'" in answer.reason
    return made


def steps(start: float, number: int) -> list[float]:
    return [start + STEP * step for step in range(number)]


def answers(client: Any, cloud: Any, count: int = 1) -> dict[int, MorphingParameters]:
    """Return the answers to a frame by their numbers, of which there are so many or more."""
    client.points.publish(cloud)
    stamp = cloud.header.stamp

    def found() -> dict[int, MorphingParameters] | None:
        those = {answer.id: answer for answer in client.answers if answer.header.stamp == stamp}
        return those if len(those) >= count else None

    client.overlay(stamp)
    return dict(client.graph.wait_for(found))


def assert_true(answer: MorphingParameters, truth: Any) -> None:
    assert answer.status == MorphingParameters.OK, answer.reason
    assert answer.header.frame_id == "world"
    np.testing.assert_allclose(answer.theta, truth, atol=0.02)


def assert_lives(client: Any, broadcaster: Broadcaster) -> None:
    start = float(next(TIMES))
    broadcaster.drive(steps(start, 3))
    found = answers(client, seen_from(base_at(start + 0.3), start + 0.3), len(BOXES))
    assert {a.status for a in found.values()} == {MorphingParameters.OK}


def test_boxes_stay_where_and_who_they_are_while_the_camera_moves(
    client: Any, broadcaster: Broadcaster
) -> None:
    """By 0.3 m and 20 degrees, with frames between the transforms, also of unequal steps."""
    numbers = set()
    for moved in np.arange(0.25, 3.0, 0.4).tolist():
        broadcaster.drive(steps(20.0 + moved - 0.25, 4))
        at = 20.0 + moved + 0.1
        found = answers(client, seen_from(base_at(at), at), len(BOXES))
        numbers.add(tuple(sorted(found)))
        for answer in found.values():
            assert_true(answer, min(BOXES, key=lambda box: math.dist(box[:2], answer.theta[:2])))
    assert len(numbers) == 1 and len(numbers.pop()) == len(BOXES)


def test_a_frame_waits_for_its_transform_and_the_node_does_not(
    client: Any, broadcaster: Broadcaster, restored: None
) -> None:
    assert client.set(transform_delay=10.0).successful
    start = float(next(TIMES))
    broadcaster.drive([start])
    cloud = seen_from(base_at(start + 0.2), start + 0.2)
    client.points.publish(cloud)
    time.sleep(0.3)
    began = time.monotonic()
    service = EstimateMorphing.Request(points=seen_from(base_at(start), start))
    assert client.call(client.estimation, service).parameters.status == MorphingParameters.OK
    assert client.set(max_range=50.0).successful
    assert time.monotonic() - began < 5.0
    assert not [a for a in client.answers if a.header.stamp == cloud.header.stamp]
    broadcaster.drive([start + 0.4])
    assert client.answer(cloud.header.stamp).status == MorphingParameters.OK


def test_it_does_not_wait_for_ever(client: Any, broadcaster: Broadcaster) -> None:
    start = float(next(TIMES))
    broadcaster.drive([start])
    (answer,) = answers(client, seen_from(base_at(start), start + 3.0)).values()
    assert answer.status == MorphingParameters.NO_OBJECT
    assert "no transform from 'world' to 'camera'" in answer.reason
    assert "'world' to 'base' is 3.00 s older" in answer.reason
    assert int(client.report()["refused_transform_stale"]) > 0
    assert_lives(client, broadcaster)


def alternate(broadcaster: Broadcaster, start: float, frame: str) -> None:
    for at in steps(start, 3):
        broadcaster.move(told("world", frame, at, ON_BASE), told("base", frame, at, ON_BASE))


def loop(broadcaster: Broadcaster, start: float, frame: str) -> None:
    broadcaster.move(told(frame, "a", start, ON_BASE), told("a", frame, start, ON_BASE))
    broadcaster.move(told(frame, "a", start + 1, ON_BASE), told("a", frame, start + 1, ON_BASE))


def pause(broadcaster: Broadcaster, start: float, frame: str) -> None:
    elsewhere = ON_BASE + 0.1
    elsewhere[:3, :3], elsewhere[3] = ON_BASE[:3, :3], ON_BASE[3]
    broadcaster.move(told("base", frame, start - 2.0, ON_BASE))
    broadcaster.move(told("base", frame, start + 2.0, elsewhere))


def come_late(broadcaster: Broadcaster, start: float, frame: str) -> None:
    broadcaster.move(*(told("base", frame, start + later, ON_BASE) for later in (1.0, 2.0)))


def stand_apart(broadcaster: Broadcaster, start: float, frame: str) -> None:
    broadcaster.move(*(told("elsewhere", frame, start + at, ON_BASE) for at in (0.0, 1.0)))


def be_no_number(broadcaster: Broadcaster, start: float, frame: str) -> None:
    nowhere = ON_BASE.copy()
    nowhere[:3, 3] = math.nan
    broadcaster.move(*(told("base", frame, start + at, nowhere) for at in (0.0, 1.0)))


BAD: dict[str, tuple[Callable[[Broadcaster, float, str], None], str, str]] = {
    "two parents": (alternate, "two_parents", "two parents, "),
    "a loop": (loop, "loop", "in a loop"),
    "a gap": (pause, "gap", "moved while there was no transform of it for 4.00 s"),
    "from later": (come_late, "too_old", "is 0.90 s newer"),
    "another tree": (stand_apart, "disconnected", "with the roots 'world' and 'elsewhere'"),
    "not finite": (be_no_number, "unknown_frame", "no transform names the frame"),
    "nobody knows": (lambda *_: None, "unknown_frame", "no transform names the frame"),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_transforms_are_a_reason_and_the_node_lives(
    client: Any, broadcaster: Broadcaster, name: str
) -> None:
    say, reason, text = BAD[name]
    start, frame = float(next(TIMES)), name.replace(" ", "_")
    broadcaster.drive(steps(start, 3))
    say(broadcaster, start, frame)
    (answer,) = answers(client, seen_from(base_at(start + 0.1), start + 0.1, frame)).values()
    assert answer.status == MorphingParameters.NO_OBJECT
    assert text in answer.reason
    report = client.report()
    assert int(report[f"refused_transform_{reason}"]) > 0
    assert int(report[f"transforms_failed_{reason}"]) > 0
    assert_lives(client, broadcaster)


def test_time_that_goes_back_makes_a_new_past(client: Any, broadcaster: Broadcaster) -> None:
    """As when a simulation starts anew: what was known then is of another world."""
    start = float(next(TIMES))
    broadcaster.move(
        *(told("world", "base", start + at, pose_2d(5.0, 5.0, 1.0)) for at in steps(0.0, 30))
    )
    broadcaster.drive(steps(start, 2))
    cloud = seen_from(base_at(start + 0.1), start + 0.1)
    for answer in answers(client, cloud).values():
        assert answer.status == MorphingParameters.OK
    late = seen_from(base_at(start + 2.0), start + 2.0)
    (answer,) = answers(client, late).values()
    assert "1.75 s older" in answer.reason  # not what held at that time before
    assert int(client.report()["transforms_jumps_back"]) > 0


def test_the_support_plane_is_a_frame_of_its_own(client: Any, restored: None) -> None:
    """Tied to the camera, so that with its true pose the boxes are where they are."""
    assert client.set(camera_pose="support_plane", crop=False).successful
    transforms: list[TFMessage] = []
    client.create_subscription(TFMessage, "/tf", transforms.append, 100)
    client.graph.wait_for(lambda: client.count_publishers("/tf") > 1)
    start, base = float(next(TIMES)), pose_2d(-0.7, 0.3, -0.4)

    def transform(stamp: Any) -> Any:
        told = [each for message in transforms for each in message.transforms]
        return next((each for each in told if each.header.stamp == stamp), None)

    found = answers(client, seen_from(base, start), len(BOXES))
    plane = client.graph.wait_for(lambda: transform(next(iter(found.values())).header.stamp))
    assert (plane.header.frame_id, plane.child_frame_id) == (FRAME, "support_plane")
    place, turn = plane.transform.translation, plane.transform.rotation
    in_camera = np.eye(4)
    in_camera[:3, :3] = matrix_from_quaternion([turn.x, turn.y, turn.z, turn.w])
    in_camera[:3, 3] = place.x, place.y, place.z
    in_world = base @ ON_BASE @ in_camera
    assert len(found) == len(BOXES)
    for answer in found.values():
        assert answer.status == MorphingParameters.OK, answer.reason
        assert answer.header.frame_id == "support_plane"
        centre = in_world @ answer.transform.reshape(4, 4) @ [0.0, 0.0, 0.1, 1.0]
        true = [MODEL.transformation.matrix(theta) @ [0.0, 0.0, 0.1, 1.0] for theta in BOXES]
        assert min(math.dist(centre, place) for place in true) < 0.01


def test_transforms_of_a_robot_in_a_namespace_are_taken(graph: Any, client: Any) -> None:
    """As robots have them that are several: ``/tf`` is not for all."""
    arguments = ["--ros-args", *namespace_arguments("/robot"), "-p", "model:=box"]
    arguments += ["-p", "cluster_step:=0.02", "-p", "iterations:=10"]
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    fixed = client.create_publisher(TFMessage, "/robot/tf_static", latched)
    base = base_at(1.0)
    fixed.publish(
        TFMessage(transforms=[told("world", "base", 0.0, base), told("base", FRAME, 0.0, ON_BASE)])
    )
    points = client.create_publisher(PointCloud2, "/robot/points", 1)
    heard: list[MorphingParameters] = []
    client.create_subscription(MorphingParameters, "/robot/morphing_parameters", heard.append, 10)
    with graph.running(MorphNode, cli_args=arguments):
        graph.wait_for(points.get_subscription_count)
        points.publish(seen_from(base, float(next(TIMES))))
        answer = graph.wait_for(lambda: heard)[-1]
    assert_true(answer, min(BOXES, key=lambda box: math.dist(box[:2], answer.theta[:2])))
