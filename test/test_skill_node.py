"""Whatever goes wrong, skill_node says what, holds the robot, and opens the next door.

The simulator, perception and skill are real nodes, in one process, in simulated time. To open a
door takes some time, so that several cases share the opening that shows that nothing is broken.
"""

from __future__ import annotations

import math
import multiprocessing
import os
import signal
from collections.abc import Iterator
from copy import deepcopy
from typing import Any

import pytest
from action_msgs.msg import GoalStatus
from control_msgs.action import FollowJointTrajectory
from rclpy.parameter import Parameter
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectoryPoint

from kmn_msgs.action import OpenDoor
from kmn_msgs.msg import MorphingParameters
from kmn_perception.ros.morph_node import MorphNode

pytest.importorskip("pybullet")
pytest.importorskip("robotic")
from door_client import CAMERA_RATE, PATIENT, PULL, RELAYED, SPEED, DoorClient  # noqa: E402
from kmn_skill.planning.robot import RobotModel  # noqa: E402
from kmn_skill.ros.locked_action_client import LockedActionClient  # noqa: E402
from kmn_skill.ros.skill_node import SkillNode  # noqa: E402

SLOW, STEADY = 1.0, 0.3  # simulated seconds in one second
SIMULATED_TIME = Parameter("use_sim_time", value=True)
PR2 = RobotModel.load("pr2")


@pytest.fixture(scope="module")
def system(graph: Any) -> Iterator[DoorClient]:
    made = graph.start(lambda **_: DoorClient(graph))
    made.start_simulator()
    reliable = Parameter("reliability", value="reliable")
    graph.start(MorphNode, parameter_overrides=[SIMULATED_TIME, reliable])
    patient = [Parameter(name, value=value) for name, value in PATIENT.items()]
    relayed = ["--ros-args", "-r", f"joint_states:={RELAYED}"]
    overrides = [SIMULATED_TIME, *patient]
    graph.start(SkillNode, parameter_overrides=overrides, cli_args=relayed)
    assert made.action.wait_for_server(30.0)
    made.graph.wait_for(lambda: made.perceived)
    yield made
    made.stop_simulator()


def test_a_door_is_opened(system: DoorClient) -> None:
    status, result = system.result(system.send())
    assert result.reason == ""
    assert (status, result.success) == (GoalStatus.STATUS_SUCCEEDED, True)
    assert result.handle_angle < -0.55
    assert result.door_angle < -0.8
    system.wait_for_door(result.door_angle)
    assert 0.0 < result.planning_time < 60.0
    assert result.attempts == 1
    system.graph.wait_for(lambda: system.feedback[-1].progress == pytest.approx(1.0))
    phases = list(dict.fromkeys(feedback.phase for feedback in system.feedback))
    assert phases == ["wait", "plan", "reach", "grasp", "press", "open"]
    progress = [feedback.progress for feedback in system.feedback]
    assert progress == sorted(progress)
    assert {"base", "handle", "door"} <= {marker.ns for marker in system.paths[-1]}
    assert system.report()["goals_success"] == "1"


def test_a_goal_beyond_the_joints_gets_a_clear_result(system: DoorClient) -> None:
    assert "-1.5 is beyond the joint 'handle'" in system.fail(handle_angle=-1.5)
    assert "2 is beyond the joint 'hinge'" in system.fail(door_angle=2.0)
    assert "nan is beyond" in system.fail(door_angle=math.nan)
    assert "0 does not open" in system.fail(door_angle=0.0)
    system.assert_it_holds()


def test_a_second_goal_is_rejected_and_a_cancelled_one_holds_the_robot(system: DoorClient) -> None:
    system.start_anew()
    first = system.send()
    system.wait_for_phase("reach", 0.1)
    assert not system.wait(system.action.send_goal_async(OpenDoor.Goal(**PULL))).accepted
    system.graph.wait_for(lambda: any("goal rejected: another one" in text for text in system.log))
    system.wait(first.cancel_goal_async())
    status, result = system.result(first)
    assert (status, result.success) == (GoalStatus.STATUS_CANCELED, False)
    assert "cancelled" in result.reason
    system.assert_it_holds()
    assert int(system.report()["goals_rejected"]) == 1


@pytest.mark.parametrize(
    ("phase", "progress", "next_phase"),
    [pytest.param("reach", 0.2, "reach", marks=pytest.mark.slow), ("open", 0.8, "release")],
)
def test_after_a_cancelled_goal_the_door_is_opened_from_there(
    system: DoorClient, phase: str, progress: float, next_phase: str
) -> None:
    """On its way the robot hides the door, then the hand is at the pressed handle."""
    system.start_anew()
    with system.pace(SLOW):
        first = system.send()
        system.wait_for_phase(phase, progress)
        system.wait(first.cancel_goal_async())
        system.result(first)
    seen = len(system.perceived)
    system.graph.wait_for(lambda: len(system.perceived) > seen + PATIENT["min_consistent_frames"])
    status, result = system.result(system.send())
    assert result.reason == ""
    assert (status, result.success) == (GoalStatus.STATUS_SUCCEEDED, True)
    assert next(f.phase for f in system.feedback if f.phase not in ("wait", "plan")) == next_phase
    assert result.door_angle < -0.8
    # A door that is let go moves a little by itself, which nobody tells.
    system.graph.wait_for(lambda: system.doors[-1].position[0] < -0.7)


def test_a_robot_whose_goal_is_cancelled_stands_soon(system: DoorClient) -> None:
    """The base within 0.2 s; what its stop swings of the arm, a moment later."""
    system.start_anew()
    handle = system.send()
    system.wait_for_phase("reach", 0.2)
    with system.pace(STEADY):
        since, _ = system.state()
        system.wait(handle.cancel_goal_async())
        system.assert_it_stops(since, 0.25)
    system.result(handle)


def test_a_robot_whose_states_are_lost_stands_0_2_s_later(system: DoorClient) -> None:
    """Where it is then is known from what it was sent."""
    system.start_anew()
    handle = system.send()
    system.wait_for_phase("reach", 0.2)
    with system.pace(STEADY):
        assert system.set(state_timeout=0.3).successful
        try:
            since, _ = system.state()
            system.relays = False
            system.assert_it_stops(since, 0.3 + 0.2)
            _, result = system.result(handle)
            assert "joint_states stopped" in result.reason or "old by its stamp" in result.reason
        finally:
            system.relays = True
            assert system.set(**PATIENT).successful


BAD: dict[str, dict[str, Any]] = {
    "x = 2.000 is outside": {"theta": [2.0, 0.0, 0.0]},
    "parameters are not finite": {"theta": [math.nan, 0.0, 0.0]},
    "parameters are of model 'box_a', expected 'door'": {"model": "box_a"},
    "hidden by a cat": {"status": MorphingParameters.NOT_CONVERGED, "reason": "hidden by a cat"},
}


def test_bad_parameters_of_the_door_get_a_clear_result(system: DoorClient) -> None:
    system.start_anew()
    assert system.set_simulator(camera_rate=0.1, real_time_factor=0.1).successful
    system.wait_until_no_more_is_perceived()
    good = system.perceived[-1]
    assert system.set(door_timeout=0.2, max_age=600.0).successful
    try:
        for text, changes in BAD.items():
            bad = deepcopy(good)
            for field, value in changes.items():
                setattr(bad, field, value)
            system.parameters.publish(bad)
            assert text in system.fail()
        assert system.set(max_age=0.05).successful
        system.parameters.publish(good)
        assert "the newest morphing parameters are" in system.fail()
    finally:
        assert system.set(**PATIENT).successful
        pace = {"camera_rate": CAMERA_RATE, "real_time_factor": SPEED}
        assert system.set_simulator(**pace).successful
    system.assert_it_holds()


def test_a_planner_that_was_killed_is_started_again(system: DoorClient) -> None:
    system.start_anew()
    handle = system.send()
    system.wait_for_phase("plan")
    for process in multiprocessing.active_children():
        assert process.pid is not None
        os.kill(process.pid, signal.SIGKILL)
    _, result = system.result(handle)
    assert result.success or "the planner's process died" in result.reason
    system.assert_it_opens()


def test_a_hand_that_another_one_opens_grasps_again(system: DoorClient) -> None:
    gripper = LockedActionClient(system, FollowJointTrajectory, PR2.controllers["gripper"].name)
    assert gripper.wait_for_server(30.0)
    system.start_anew()
    handle = system.send()
    system.wait_for_phase("press")
    system.feedback.clear()

    let_go = FollowJointTrajectory.Goal()
    let_go.trajectory.joint_names = [PR2.gripper.joint]
    let_go.trajectory.points = [JointTrajectoryPoint(positions=[PR2.planning.grip.open])]
    let_go.trajectory.points[0].time_from_start.nanosec = 10**8
    sent: list[Any] = []  # one after the other: the robot's next part closes the hand again

    def looks_again() -> bool:
        if not sent or sent[-1].done():
            sent.append(gripper.send_goal_async(let_go))
        return any(feedback.phase in ("plan", "look") for feedback in system.feedback)

    system.graph.wait_for(looks_again)
    _, result = system.result(handle)
    assert result.reason == ""
    assert result.success
    assert result.attempts >= 2
    assert result.door_angle < -0.8
    system.wait_for_door(result.door_angle)


def test_a_simulator_that_is_reset_half_way_ends_the_goal(system: DoorClient) -> None:
    system.start_anew()
    handle = system.send()
    system.wait_for_phase("reach", 0.4)  # far enough from home for a jump
    system.wait(system.reset.call_async(Trigger.Request()))
    status, result = system.result(handle)
    assert (status, result.success) == (GoalStatus.STATUS_ABORTED, False)
    assert "jumped by" in result.reason
    system.assert_it_holds()


def test_a_simulator_that_dies_half_way_ends_the_goal_and_may_come_again(
    system: DoorClient,
) -> None:
    system.start_anew()
    handle = system.send()
    system.wait_for_phase("reach", 0.2)
    system.stop_simulator()
    status, result = system.result(handle)
    assert (status, result.success) == (GoalStatus.STATUS_ABORTED, False)
    assert "stopped" in result.reason
    system.wait_for_hold()
    system.start_simulator()
    system.assert_it_opens()
