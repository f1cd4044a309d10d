"""Users choose the quality of service of any topic of the nodes; other nodes are told by DDS."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, ReliabilityPolicy

from kmn_perception.configuration.node_parameters import ParameterError
from kmn_perception.ros.morph_node import MorphNode
from kmn_perception.ros.parameters import foreign_parameters

pytest.importorskip("pybullet")
pytest.importorskip("robotic")
from kmn_sim.ros.sim_node import SimNode  # noqa: E402
from kmn_skill.ros.skill_node import SkillNode  # noqa: E402

NODES: dict[type[Node], dict[str, Any]] = {
    MorphNode: {"model": "room_door"},
    SimNode: {"publish_clock": True},
    SkillNode: {"door_angles": "door_state"},
}
OF_RCLPY = ("/rosout", "/parameter_events")
QOS = "qos_overrides./lab"


@pytest.fixture(scope="module")
def observer(graph: Any) -> Iterator[Node]:
    node = Node("observer", context=graph.context)
    yield node
    node.destroy_node()


def overrides(values: dict[str, Any]) -> dict[str, Any]:
    """Return the options of a node in the namespace ``lab`` with values of parameters."""
    made = [Parameter(name, value=value) for name, value in values.items()]
    return {"namespace": "lab", "parameter_overrides": made}


def topics(node: Node) -> set[str]:
    """Return a node's topics but those of actions, each with what the node is to it."""
    name, space = node.get_name(), node.get_namespace()
    published = node.get_publisher_names_and_types_by_node(name, space)
    subscribed = node.get_subscriber_names_and_types_by_node(name, space)
    found = {(topic, "publisher") for topic, _ in published}
    found |= {(topic, "subscription") for topic, _ in subscribed}
    return {
        f"{topic}.{kind}"
        for topic, kind in found
        if "/_action/" not in topic and topic not in OF_RCLPY
    }


@pytest.mark.parametrize("make", NODES, ids=lambda make: make.__name__)
def test_all_topics_of_the_nodes_can_be_overridden(graph: Any, make: type[Node]) -> None:
    with graph.running(make, **overrides(NODES[make])) as node:
        graph.wait_for(lambda: any("/diagnostics" in topic for topic in topics(node)))
        found = topics(node)
        assert len(found) > 5
        for policy in ("history", "depth", "reliability"):
            lacking = [t for t in found if not node.has_parameter(f"qos_overrides.{t}.{policy}")]
            assert lacking == []


def test_what_is_overridden_is_so_and_nothing_else(graph: Any, observer: Node) -> None:
    values = {
        f"{QOS}/depth/image.subscription.reliability": "reliable",
        f"{QOS}/object_description.publisher.reliability": "best_effort",
    }
    with graph.running(MorphNode, **overrides(values)) as node:
        assert foreign_parameters(node) == []

        def told(topic: str, published: bool = False) -> Any:
            ask = observer.get_subscriptions_info_by_topic
            ask = observer.get_publishers_info_by_topic if published else ask
            (info,) = graph.wait_for(lambda: ask(f"/lab/{topic}"))
            return info.qos_profile

        assert told("depth/image").reliability == ReliabilityPolicy.RELIABLE
        for topic in ("depth/camera_info", "points"):  # nobody publishes them
            assert told(topic).reliability == ReliabilityPolicy.BEST_EFFORT
        description = told("object_description", published=True)
        assert description.reliability == ReliabilityPolicy.BEST_EFFORT
        assert description.durability == DurabilityPolicy.TRANSIENT_LOCAL  # latched as ever
        assert told("detections", published=True).reliability == ReliabilityPolicy.RELIABLE


def test_an_override_goes_before_the_parameter_reliability(graph: Any, observer: Node) -> None:
    values = {"reliability": "reliable", f"{QOS}/points.subscription.reliability": "best_effort"}
    with graph.running(MorphNode, **overrides(values)):
        for topic, kind in (("points", "BEST_EFFORT"), ("depth/image", "RELIABLE")):
            (info,) = graph.wait_for(
                lambda topic=topic: observer.get_subscriptions_info_by_topic(f"/lab/{topic}")
            )
            assert info.qos_profile.reliability == ReliabilityPolicy[kind]


@pytest.mark.parametrize(
    ("policy", "value", "text"),
    [
        ("reliability", "very", "'/lab/points'.*reliability.*very"),
        ("depth", -1, "'/lab/points'.*depth is -1, expected 0 or more"),
    ],
)
def test_a_wrong_override_is_refused_with_the_reason(
    graph: Any, policy: str, value: Any, text: str
) -> None:
    with pytest.raises(ParameterError, match=text):
        MorphNode(
            context=graph.context, **overrides({f"{QOS}/points.subscription.{policy}": value})
        )


def test_an_override_of_a_topic_that_the_node_does_not_have_is_told(graph: Any) -> None:
    name = f"{QOS}/pionts.subscription.depth"
    with graph.running(MorphNode, **overrides({name: 5})) as node:
        (text,) = foreign_parameters(node)
        assert f"there is no parameter '{name}', its value is ignored; did you mean" in text
        assert "/lab/points.subscription.depth" in text
