"""skill_node opens a door through the actions of the robot's controllers."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
from action_msgs.msg import GoalStatus
from control_msgs.action import FollowJointTrajectory
from rclpy.parameter import Parameter

pytest.importorskip("pybullet")
pytest.importorskip("robotic")
from door_client import PATIENT, TrueDoorClient  # noqa: E402
from kmn_skill.planning.robot import RobotModel  # noqa: E402
from kmn_skill.ros.locked_action_client import LockedActionClient  # noqa: E402
from kmn_skill.ros.skill_node import SkillNode  # noqa: E402
from sim_client import trajectory  # noqa: E402

ARM = RobotModel.load("pr2").controllers["arm"]
STEADY = 0.3  # simulated seconds in one second


class ControllerClient(TrueDoorClient):
    """Takes the arm over from others."""

    def __init__(self, graph: Any) -> None:
        super().__init__(graph)
        self.arm = LockedActionClient(self, FollowJointTrajectory, ARM.name)


@pytest.fixture(scope="module")
def system(graph: Any) -> Iterator[ControllerClient]:
    made = graph.start(lambda **_: ControllerClient(graph))
    made.start_simulator()
    values = {**PATIENT, "control": "action", "use_sim_time": True}
    graph.start(
        SkillNode, parameter_overrides=[Parameter(name, value=v) for name, v in values.items()]
    )
    assert made.action.wait_for_server(30.0)
    made.graph.wait_for(lambda: made.perceived)
    yield made
    made.stop_simulator()


def test_a_door_is_opened_without_a_word_on_the_topic(system: ControllerClient) -> None:
    system.assert_it_opens()
    assert not system.sent
    phases = list(dict.fromkeys(feedback.phase for feedback in system.feedback))
    assert phases == ["wait", "plan", "reach", "grasp", "press", "open"]


def test_a_robot_whose_goal_is_cancelled_stands_soon(system: ControllerClient) -> None:
    system.start_anew()
    handle = system.send()
    system.wait_for_phase("reach", 0.2)
    with system.pace(STEADY):
        since, _ = system.state()
        system.wait(handle.cancel_goal_async())
        system.assert_it_stops(since, 0.25)
    assert system.result(handle)[0] == GoalStatus.STATUS_CANCELED


def test_a_controller_that_somebody_takes_over_ends_the_goal_and_is_named(
    system: ControllerClient,
) -> None:
    """The others are cancelled: with the base under way, nothing else would stop it."""
    system.start_anew()
    handle = system.send()
    system.wait_for_phase("reach", 0.2)
    with system.pace(STEADY):
        newest = system.joints[-1]
        now = dict(zip(newest.name, newest.position, strict=True))
        there = trajectory((0.05, *(now[name] for name in ARM.joints)), names=ARM.joints)
        since, _ = system.state()
        system.send_goal(system.arm, FollowJointTrajectory.Goal(trajectory=there))
        system.assert_it_stops(since, 0.4)
    status, result = system.result(handle)
    assert (status, result.success) == (GoalStatus.STATUS_ABORTED, False)
    assert "the controller 'arm' aborted its goal, INVALID_GOAL: preempted" in result.reason


def test_a_newer_goal_ends_the_one_that_runs_if_that_is_allowed(system: ControllerClient) -> None:
    system.start_anew()
    assert system.set(preempt=True).successful
    try:
        first = system.send()
        system.wait_for_phase("reach", 0.1)
        second = system.send()
        assert second.accepted
        status, result = system.result(first)
        assert (status, result.success) == (GoalStatus.STATUS_ABORTED, False)
        assert result.reason == "a newer goal took its place"
        system.wait_for_phase("reach", 0.1)
        waiting = [system.send() for _ in range(4)]
        newest = system.send()
        for each in (second, *waiting):  # in the order in which they came, none after the newest
            assert system.result(each)[0] == GoalStatus.STATUS_ABORTED
        system.wait(newest.cancel_goal_async())
        assert system.result(newest)[0] == GoalStatus.STATUS_CANCELED
    finally:
        assert system.set(preempt=False).successful
    reports = system.report()
    assert int(reports["goals_preempted"]) == 6
