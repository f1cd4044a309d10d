"""operate_joint: a drawer, of which the nodes know nothing but its file, is opened and told of."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml
from action_msgs.msg import GoalStatus
from geometry_msgs.msg import WrenchStamped
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile

from kmn_msgs.action import OpenDoor, OperateJoint
from kmn_msgs.msg import MorphingParameters
from kmn_perception.configuration import resources

pytest.importorskip("pybullet")
pytest.importorskip("robotic")
from door_client import ALL, PATIENT, TrueDoorClient  # noqa: E402
from kmn_skill.ros.locked_action_client import LockedActionClient  # noqa: E402
from kmn_skill.ros.skill_node import SkillNode  # noqa: E402


class DrawerClient(TrueDoorClient):
    """Sends goals for a joint."""

    def __init__(self, graph: Any) -> None:
        super().__init__(graph)
        self.operate = LockedActionClient(
            self, OperateJoint, "operate_joint", feedback_sub_qos_profile=QoSProfile(depth=ALL)
        )
        self.told: list[OperateJoint.Feedback] = []

    def move(self, **goal: Any) -> tuple[int, OperateJoint.Result]:
        """Send a goal, and return how it ended."""
        self.told.clear()
        request = OperateJoint.Goal(**{"target": math.nan, **goal})
        handle = self.send_goal(self.operate, request, lambda m: self.told.append(m.feedback))
        answer = self.wait(handle.get_result_async())
        return answer.status, answer.result


@pytest.fixture(scope="module")
def system(graph: Any) -> Iterator[DrawerClient]:
    made = graph.start(lambda **_: DrawerClient(graph))
    made.start_simulator(model="drawer")
    given = {**PATIENT, "use_sim_time": True, "model": "drawer", "retries": 0}
    overrides = [Parameter(name, value=value) for name, value in given.items()]
    graph.start(SkillNode, parameter_overrides=overrides)
    try:
        assert made.operate.wait_for_server(30.0)
        made.graph.wait_for(lambda: made.perceived)
        yield made
    finally:
        made.stop_simulator()


@pytest.mark.parametrize(
    ("goal", "reason"),
    [
        ({"model": "fridge"}, "model 'fridge' is asked for, expected 'drawer'"),
        ({"joint": "hinge"}, "joint 'hinge' is asked for, expected 'slide'"),
        ({"target": -0.5}, r"-0.5 is beyond the joint 'slide', expected [-0.4, 0] m"),
        ({"target": 0.0}, "0 does not open the joint 'slide'"),
    ],
)
def test_what_cannot_be_asked_of_it_is_said(
    system: DrawerClient, goal: dict[str, Any], reason: str
) -> None:
    status, result = system.move(**goal)
    assert (status, result.error_code) == (GoalStatus.STATUS_ABORTED, result.INVALID_GOAL)
    assert reason in result.reason


def test_a_drawer_is_not_what_perception_tells_to_be_another_object(system: DrawerClient) -> None:
    """The object that is asked for is a lid, of another model of the same morph_node."""
    assert system.set(door_timeout=4.0).successful
    told = MorphingParameters(model="lid", id=7, status=MorphingParameters.OK)
    told.header.frame_id = "world"
    timer = system.create_timer(0.1, lambda: system.parameters.publish(told))
    status, result = system.move(object_id=7)
    system.destroy_timer(timer)
    assert system.set(door_timeout=PATIENT["door_timeout"]).successful
    assert (status, result.error_code) == (GoalStatus.STATUS_ABORTED, result.DOOR_UNUSABLE)
    assert "parameters are of model 'lid', expected 'drawer'" in result.reason
    assert all(len(trajectory.points) == 1 for trajectory in system.sent)  # to hold


def test_a_door_s_goal_presses_no_handle_that_is_not_there(system: DrawerClient) -> None:
    assert "there is no such thing: expected 0" in system.fail(handle_angle=-0.7, door_angle=-0.3)


def test_the_drawer_is_opened_as_far_as_its_file_says(system: DrawerClient) -> None:
    status, result = system.move(model="drawer", joint="slide")
    assert result.reason == ""
    assert (status, result.error_code) == (GoalStatus.STATUS_SUCCEEDED, result.SUCCESS)
    assert result.position == pytest.approx(-0.3, abs=0.02)
    system.graph.wait_for(lambda: abs(system.doors[-1].position[0] - result.position) < 0.02)
    assert list(system.doors[-1].name) == ["slide"]
    positions = [each.position for each in system.told if each.phase == "open"]
    assert min(positions) < -0.2 and max(positions) > -0.2


def test_the_same_by_the_door_s_action(system: DrawerClient) -> None:
    """Its angles are then metres; what it is not for it does not refuse."""
    system.start_anew()
    handle = system.send_goal(system.action, OpenDoor.Goal(handle_angle=0.0, door_angle=-0.2))
    answer = system.wait(handle.get_result_async())
    assert answer.result.success
    assert answer.result.door_angle == pytest.approx(-0.2, abs=0.02)


@pytest.mark.parametrize(
    ("frame", "newtons", "reason"),
    [("world", math.nan, "the force is not finite"), ("nowhere", 1.0, "'nowhere'")],
)
def test_a_force_that_is_none_is_refused_with_the_reason(
    system: DrawerClient, frame: str, newtons: float, reason: str
) -> None:
    publisher = system.create_publisher(WrenchStamped, "handle_force", 1)
    message = WrenchStamped()
    message.header.frame_id, message.wrench.force.x = frame, newtons
    system.graph.wait_for(lambda: publisher.get_subscription_count() > 0)
    publisher.publish(message)
    system.graph.wait_for(
        lambda: any("handle_force refused" in text and reason in text for text in system.log)
    )
    system.destroy_publisher(publisher)


def test_a_drawer_that_is_stuck_is_told_by_the_force_that_it_takes(
    system: DrawerClient, tmp_path: Path
) -> None:
    """Before the hand slips off; it is not tried again, though it might be."""
    content = yaml.safe_load(resources.find("config/models", "drawer").read_text())
    content["mechanics"]["joints"]["slide"]["friction"] = 1000.0
    stuck = tmp_path / "drawer.yaml"
    stuck.write_text(yaml.safe_dump(content, sort_keys=False), encoding="utf-8")
    assert system.set_simulator(model=str(stuck)).successful
    assert system.set(retries=2).successful
    status, result = system.move()
    assert (status, result.error_code) == (GoalStatus.STATUS_ABORTED, result.STUCK)
    assert re.search(
        r"slide is stuck at .* takes \d+ N to move on, expected at most 60 N", result.reason
    )
    assert result.attempts == 1
    assert abs(system.doors[-1].position[0]) < 0.01
    assert abs(result.position) < 0.03  # by which the fingers gave, before the force was told
    system.assert_it_holds()
