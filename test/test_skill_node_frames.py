"""skill_node takes doors that are given in other frames into its own, or tells why it cannot."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from rclpy.parameter import Parameter

from graph import GraphClient
from kmn_msgs.msg import MorphingParameters
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.ros.stamps import stamp_of
from transform_talk import Broadcaster, pose_2d, told

pytest.importorskip("robotic")
from kmn_skill.execution.errors import DoorError  # noqa: E402
from kmn_skill.ros.skill_node import SkillNode  # noqa: E402

MODEL = KinematicModel.load("door")
VALUES = np.array([0.1, -0.2, 0.3, 0.0, 0.0, 0.0, 0.0])


@pytest.fixture(scope="module")
def node(graph: Any) -> Iterator[SkillNode]:
    overrides = [Parameter("max_age", value=60.0), Parameter("transform_delay", value=1.0)]
    yield graph.start(SkillNode, parameter_overrides=overrides)


@pytest.fixture(scope="module")
def client(graph: Any, node: SkillNode) -> Any:
    made = graph.start(lambda **_: GraphClient(graph, "skill_node"))
    made.parameters = made.create_publisher(MorphingParameters, "morphing_parameters", 10)
    made.graph.wait_for(made.parameters.get_subscription_count)
    made.setting.wait_for_service()
    return made


def publish(client: Any, node: SkillNode, frame: str, number: int = 3) -> list[float]:
    """Publish so many frames of a door; return their stamps, seconds."""
    stamps = [node.now() + 0.01 * step for step in range(number)]
    for stamp in stamps:
        message = MorphingParameters(model="door", status=MorphingParameters.OK)
        message.header.stamp, message.header.frame_id = stamp_of(stamp), frame
        message.theta_names = [parameter.name for parameter in MODEL.theta]
        message.gamma_names = [parameter.name for parameter in MODEL.gamma]
        message.theta, message.gamma = VALUES[:3].tolist(), VALUES[3:].tolist()
        message.covariance = (1e-6 * np.eye(7)).ravel().tolist()
        client.parameters.publish(message)
    return stamps


def refused(client: Any) -> int:
    return int(client.report().get("refused_status", "0"))


def used(client: Any) -> int:
    return int(client.report().get("messages_used", "0"))


def test_a_door_without_a_transform_is_refused_and_one_with_it_is_taken(
    client: Any, node: SkillNode
) -> None:
    stamps = publish(client, node, "support_plane")
    client.graph.wait_for(lambda: refused(client) == 3)
    told_of = [text for text in client.log if "given in 'support_plane'" in text]
    assert "where that is in 'world' is not known: no transform names the frame" in told_of[0]

    broadcaster = Broadcaster(client)
    broadcaster.fix(told("world", "odom", 0.0, pose_2d(0.0, 0.0, 0.0)))
    stamps = publish(client, node, "support_plane")  # whose transforms come later
    there = pose_2d(0.2, 0.1, -0.3)
    broadcaster.move(*(told("odom", "support_plane", stamp, there) for stamp in stamps))
    client.graph.wait_for(lambda: used(client) == 3)
    values = node._skill.knowledge.door.values(node.now())
    expected = there @ MODEL.transformation.matrix(VALUES[:3])
    np.testing.assert_allclose(MODEL.transformation.matrix(values[:3]), expected, atol=1e-6)


def test_a_door_on_another_ground_is_refused(client: Any, node: SkillNode) -> None:
    broadcaster = Broadcaster(client)
    above = pose_2d(0.0, 0.0, 0.0)
    above[2, 3] = 0.3
    before = refused(client)
    broadcaster.fix(
        told("world", "odom", 0.0, pose_2d(0.0, 0.0, 0.0)), told("odom", "table", 0.0, above)
    )
    publish(client, node, "table", 1)
    client.graph.wait_for(lambda: refused(client) > before)
    with pytest.raises(
        DoorError, match="the ground of 'table' is tilted by 0.0 deg and \\+0.300 m"
    ):
        node._skill.knowledge.door.values(node.now())
