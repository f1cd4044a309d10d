"""skill_node says once what lasts, and says it again when it changes."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
from rclpy.parameter import Parameter

from kmn_msgs.msg import MorphingParameters
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.ros import reports

pytest.importorskip("robotic")
from graph import GraphClient  # noqa: E402
from kmn_skill.ros.skill_node import SkillNode  # noqa: E402

MODEL = KinematicModel.load("door")
REFUSED = "morphing_parameters refused"


class Perception(GraphClient):
    """Publishes parameters of a door, good or bad."""

    def __init__(self, graph: Any) -> None:
        super().__init__(graph, "skill_node")
        self._publisher = self.create_publisher(MorphingParameters, "morphing_parameters", 10)

    def publish(self, count: int, **changes: Any) -> None:
        """Publish messages of a kind, and wait until skill_node has counted them."""
        size = len(MODEL.parameters)
        for _ in range(count):
            message = MorphingParameters(
                model=MODEL.name,
                status=MorphingParameters.OK,
                theta=[0.0] * len(MODEL.theta),
                gamma=[0.0] * len(MODEL.gamma),
                theta_names=[parameter.name for parameter in MODEL.theta],
                gamma_names=[parameter.name for parameter in MODEL.gamma],
                covariance=[0.0] * size**2,
            )
            message.header.frame_id = "world"
            message.header.stamp = self.get_clock().now().to_msg()
            for name, value in changes.items():
                setattr(message, name, value)
            before = self.counted()
            self._publisher.publish(message)
            self.graph.wait_for(lambda: self.counted() > before)  # noqa: B023

    def counted(self) -> int:
        """Return how many messages skill_node has taken or refused."""
        report = self.report()
        return int(report["messages_used"]) + int(report["messages_refused"])

    def warnings(self) -> list[str]:
        return [text for text in self.log if text.startswith(REFUSED)]


@pytest.fixture
def perception(graph: Any, monkeypatch: pytest.MonkeyPatch) -> Iterator[Perception]:
    monkeypatch.setattr(reports, "WARNING_PERIOD", 0.0)  # only what changes holds warnings back
    made = graph.start(lambda **_: Perception(graph))
    with graph.running(SkillNode):
        made.graph.wait_for(made._publisher.get_subscription_count)
        yield made


def test_an_unchanged_reason_is_said_once(perception: Perception) -> None:
    hidden = {"status": MorphingParameters.NOT_CONVERGED, "reason": "hidden by the robot"}
    perception.publish(3, **hidden)
    perception.publish(2, model="box_a")
    perception.publish(1, **hidden)
    perception.publish(1)
    perception.publish(2, **hidden)
    perception.graph.wait_for(lambda: len(perception.warnings()) >= 4)
    assert [text.removeprefix(f"{REFUSED}: ") for text in perception.warnings()] == [
        "hidden by the robot",
        "parameters are of model 'box_a', expected 'door'",
        "hidden by the robot",
        "hidden by the robot",
    ]
    assert perception.report()["refused_status"] == "6"


def test_an_object_of_an_unknown_model_is_told_once(perception: Perception) -> None:
    perception.publish(3, model="no_such_thing")
    perception.publish(1, model="../door")
    told = [text for text in perception.log if text.startswith("object refused")]
    assert len(told) == 1
    assert "'no_such_thing' is neither a file nor one of the shipped" in told[0]
    assert perception.report()["refused_unknown_model"] == "4"


def test_who_measures_the_doors_angles_is_waited_for_only_where_one_is_named(graph: Any) -> None:
    encoders = Parameter("door_angles", value="door_state")
    graph.start(SkillNode, parameter_overrides=[encoders], namespace="/with_encoders")
    graph.start(SkillNode, namespace="/without")
    client = graph.start(lambda **_: GraphClient(graph, "skill_node"))
    topics = client.get_topic_names_and_types
    client.graph.wait_for(lambda: "/with_encoders/door_state" in dict(topics()))
    assert client.count_subscribers("/with_encoders/door_state") == 1
    assert client.count_subscribers("/without/joint_states") == 1
    assert client.count_subscribers("/without/door_state") == 0
