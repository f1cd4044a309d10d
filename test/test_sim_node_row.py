"""sim_node with several objects in one world: what it tells of each, and what it refuses."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import JointState

from graph import GraphClient
from kmn_msgs.msg import MorphingParameters
from kmn_perception.model.kinematic_model import KinematicModel

pytest.importorskip("pybullet")
from kmn_sim.ros.sim_node import SimNode  # noqa: E402
from kmn_sim.world.scenario import ScenarioError  # noqa: E402

ROW = {"model": "drawer", "beside": "cupboard_door, drawer", "beside_gap": 0.2}


def start(graph: Any, **values: Any) -> Any:
    overrides = [Parameter(name, value=value) for name, value in values.items()]
    return graph.start(SimNode, parameter_overrides=overrides)


@pytest.fixture(scope="module")
def client(graph: Any) -> GraphClient:
    start(graph, **ROW, placement="random", seed=3)
    return graph.start(lambda **_: GraphClient(graph, "sim_node"))


def truths(client: GraphClient) -> dict[int, MorphingParameters]:
    """Return what who comes late is told of each object, by its id."""
    found: dict[int, MorphingParameters] = {}
    latched = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)

    def keep(told: MorphingParameters) -> None:
        found[told.id] = told

    heard = client.create_subscription(MorphingParameters, "ground_truth", keep, latched)
    client.graph.wait_for(lambda: len(found) == 3)
    client.destroy_subscription(heard)
    return found


def test_the_truth_of_each_object_has_an_id_of_its_own(client: GraphClient) -> None:
    told = truths(client)
    assert {number: each.model for number, each in told.items()} == {
        1: "drawer",
        2: "cupboard_door",
        3: "drawer",
    }
    poses = {number: np.reshape(each.transform, (4, 4)) for number, each in told.items()}
    for number, side in ((2, -1.0), (3, 1.0)):
        model = KinematicModel.load(told[number].model)
        assert model.transformation.matrix(told[number].theta) == pytest.approx(poses[number])
        place = np.linalg.inv(poses[1]) @ poses[number]
        assert place[:3, :3] == pytest.approx(np.eye(3))
        assert side * place[1, 3] > 0.5
        assert (told[number].status, any(told[number].gamma)) == (told[number].OK, True)


def test_joints_of_those_beside_have_a_topic_of_their_own(client: GraphClient) -> None:
    own: list[JointState] = []
    beside: list[JointState] = []
    for topic, kept in (("door_state", own), ("beside_state", beside)):
        client.create_subscription(JointState, topic, kept.append, 1)
    client.graph.wait_for(lambda: own and beside)
    assert list(own[-1].name) == ["slide"]
    assert list(beside[-1].name) == ["cupboard_door_2/hinge", "drawer_3/slide"]
    assert np.abs(beside[-1].position).max() < 1e-3


def test_a_wider_gap_builds_the_row_anew(client: GraphClient) -> None:
    client.setting.wait_for_service()
    before = truths(client)
    assert client.set(beside_gap=0.7).successful

    def moved() -> list[float]:
        after = truths(client)
        return [
            float(np.linalg.norm(np.subtract(after[n].theta, before[n].theta))) for n in (1, 2, 3)
        ]

    client.graph.wait_for(lambda: moved() == pytest.approx([0.0, 0.5, 0.5]))
    assert not client.set(beside="").successful  # only at the start


@pytest.mark.parametrize(
    ("values", "problem"),
    [
        ({"beside": "door"}, "model 'door' is a door that fills an opening"),
        ({"beside": "box_a"}, "model 'box_a' has no 'actions'"),
        ({"beside": "lid", "room": True}, "'room' is for doors in a wall"),
        ({"beside": "lid", "table": True}, "'table' for a box"),
    ],
)
def test_a_row_that_cannot_be_built_is_refused_at_the_start(
    graph: Any, values: dict[str, Any], problem: str
) -> None:
    with pytest.raises(ScenarioError, match=problem):
        start(graph, model="drawer", **values)
