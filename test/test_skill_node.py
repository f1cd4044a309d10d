"""Whatever goes wrong, skill_node says what, holds the robot, and opens the next door.

The simulator, perception and skill are real nodes, in one process, in simulated time. To open a
door takes some time, so that several cases share the opening that shows that nothing is broken.
"""

from __future__ import annotations

import math
import multiprocessing
import os
import signal
import time
from collections.abc import Iterator
from contextlib import ExitStack
from copy import deepcopy
from typing import Any

import numpy as np
import pytest
from action_msgs.msg import GoalStatus
from diagnostic_msgs.msg import DiagnosticArray
from numpy.typing import NDArray
from rcl_interfaces.msg import Log, SetParametersResult
from rcl_interfaces.srv import SetParametersAtomically
from rclpy.action import ActionClient  # type: ignore[attr-defined]
from rclpy.node import Node
from rclpy.parameter import Parameter
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint
from visualization_msgs.msg import Marker, MarkerArray

from kmn_msgs.action import OpenDoor
from kmn_msgs.msg import MorphingParameters
from kmn_perception.morph_node import MorphNode

pytest.importorskip("pybullet")
pytest.importorskip("robotic")
from kmn_sim.sim_node import SimNode  # noqa: E402
from kmn_skill.skill_node import SkillNode  # noqa: E402

SEED = 3  # of a door that is wholly in view
SPEED = 4.0  # simulated seconds in one second
CAMERA_RATE = 0.5  # frames a simulated second
# With so slow a camera and so fast a clock.
PATIENT = {"frames": 2, "max_age": 20.0, "door_timeout": 40.0, "state_timeout": 1.0 * SPEED}
PULL = {"handle_angle": -0.7, "door_angle": -0.9}
SIMULATED_TIME = Parameter("use_sim_time", value=True)


class System(Node):
    """Starts and stops the simulator, sends goals, and keeps what the nodes publish."""

    def __init__(self, graph: Any) -> None:
        super().__init__("client", context=graph.context)
        self.graph = graph
        self.joints: list[JointState] = []
        self.doors: list[JointState] = []
        self.sent: list[JointTrajectory] = []
        self.paths: list[list[Marker]] = []
        self.log: list[str] = []
        self.feedback: list[OpenDoor.Feedback] = []
        self.reports: list[dict[str, str]] = []
        self.perceived: list[MorphingParameters] = []
        for kind, name, kept in (
            (JointState, "joint_states", self.joints),
            (JointState, "door_state", self.doors),
            (JointTrajectory, "joint_trajectory", self.sent),
            (MorphingParameters, "morphing_parameters", self.perceived),
        ):
            self.create_subscription(kind, name, kept.append, 10)
        self.create_subscription(MarkerArray, "planned_path", self._keep_path, 10)
        self.create_subscription(DiagnosticArray, "/diagnostics", self._keep_report, 10)
        self.create_subscription(Log, "/rosout", self._keep_log, 100)
        self.parameters = self.create_publisher(MorphingParameters, "morphing_parameters", 10)
        self.trajectory = self.create_publisher(JointTrajectory, "joint_trajectory", 10)
        self.reset = self.create_client(Trigger, "reset")
        self.action = ActionClient(self, OpenDoor, "open_door")
        self._setting = {
            node: self.create_client(SetParametersAtomically, f"{node}/set_parameters_atomically")
            for node in ("sim_node", "skill_node")
        }
        self._simulator = ExitStack()

    def _keep_path(self, message: MarkerArray) -> None:
        self.paths.append(message.markers)

    def _keep_log(self, message: Log) -> None:
        self.log.append(message.msg)

    def _keep_report(self, message: DiagnosticArray) -> None:
        if "skill_node" in message.status[0].name:
            values = [value for status in message.status for value in status.values]
            self.reports.append({value.key: value.value for value in values})

    def start_simulator(self) -> None:
        """Start a simulator, in which the robot and a door stand where they start."""
        overrides = [
            Parameter("real_time_factor", value=SPEED),
            Parameter("publish_clock", value=True),
            Parameter("placement", value="random"),
            Parameter("seed", value=SEED),
            Parameter("camera_rate", value=CAMERA_RATE),
        ]
        self._simulator.enter_context(self.graph.running(SimNode, parameter_overrides=overrides))
        self.joints.clear()
        self.graph.wait_for(lambda: self.joints and self.doors)

    def stop_simulator(self) -> None:
        self._simulator.close()

    def set(self, node: str, **values: Any) -> SetParametersResult:
        request = SetParametersAtomically.Request(
            parameters=[Parameter(name, value=v).to_parameter_msg() for name, v in values.items()]
        )
        client = self._setting[node]
        assert client.wait_for_service(30.0)
        return self.wait(client.call_async(request)).result

    def wait(self, future: Any) -> Any:
        self.graph.wait_for(future.done)
        return future.result()

    def send(self, **angles: float) -> Any:
        """Send a goal, and return its handle."""
        self.feedback.clear()
        self.sent.clear()
        goal = OpenDoor.Goal(**{**PULL, **angles})
        return self.wait(
            self.action.send_goal_async(goal, lambda m: self.feedback.append(m.feedback))
        )

    def result(self, handle: Any) -> tuple[int, OpenDoor.Result]:
        answer = self.wait(handle.get_result_async())
        return answer.status, answer.result

    def fail(self, **angles: float) -> str:
        """Send a goal that must end without success, and return the reason."""
        status, result = self.result(self.send(**angles))
        assert (status, result.success) == (GoalStatus.STATUS_ABORTED, False)
        return str(result.reason)

    def wait_for_phase(self, phase: str, progress: float = 0.0) -> None:
        self.graph.wait_for(
            lambda: any(f.phase == phase and f.progress >= progress for f in self.feedback)
        )

    def report(self) -> dict[str, str]:
        self.reports.clear()
        return self.graph.wait_for(lambda: self.reports)[-1]

    def positions(self) -> NDArray[np.float64]:
        """Wait for a state, and return the robot's positions."""
        self.joints.clear()
        return np.array(self.graph.wait_for(lambda: self.joints)[-1].position)

    def start_anew(self) -> None:
        """Put the robot and the door where they start, and wait until the door was seen there."""
        assert self.wait(self.reset.call_async(Trigger.Request())).success
        time.sleep(0.2)
        self.perceived.clear()

    def assert_it_opens(self) -> None:
        """Assert that the door opens from its start."""
        self.start_anew()
        status, result = self.result(self.send())
        assert result.reason == ""
        assert (status, result.success) == (GoalStatus.STATUS_SUCCEEDED, True)
        assert self.doors[-1].position[0] < -0.8

    def assert_it_holds(self) -> None:
        """Assert that the last thing sent was to hold, and that the robot does."""
        assert self.sent[-1].points == []
        time.sleep(0.1)
        before = self.positions()
        time.sleep(0.3)
        np.testing.assert_allclose(self.positions()[:10], before[:10], atol=0.01)


@pytest.fixture(scope="module")
def system(graph: Any) -> Iterator[System]:
    made = graph.start(lambda **_: System(graph))
    made.start_simulator()
    reliable = Parameter("reliability", value="reliable")
    graph.start(MorphNode, parameter_overrides=[SIMULATED_TIME, reliable])
    patient = [Parameter(name, value=value) for name, value in PATIENT.items()]
    graph.start(SkillNode, parameter_overrides=[SIMULATED_TIME, *patient])
    assert made.action.wait_for_server(30.0)
    made.graph.wait_for(lambda: made.perceived)
    yield made
    made.stop_simulator()


def test_a_door_is_opened(system: System) -> None:
    status, result = system.result(system.send())
    assert result.reason == ""
    assert (status, result.success) == (GoalStatus.STATUS_SUCCEEDED, True)
    assert result.handle_angle < -0.55
    assert result.door_angle < -0.8
    assert system.doors[-1].position[0] == pytest.approx(result.door_angle, abs=0.05)
    assert 0.0 < result.planning_time < 60.0
    assert result.attempts == 1
    phases = list(dict.fromkeys(feedback.phase for feedback in system.feedback))
    assert phases == ["wait", "plan", "reach", "grasp", "press", "open"]
    progress = [feedback.progress for feedback in system.feedback]
    assert progress == sorted(progress)
    assert progress[-1] == pytest.approx(1.0)
    assert {"base", "handle", "door"} <= {marker.ns for marker in system.paths[-1]}
    assert system.report()["goals_success"] == "1"


def test_a_goal_beyond_the_joints_gets_a_clear_result(system: System) -> None:
    assert "handle_angle = -1.5 is beyond the joint 'handle'" in system.fail(handle_angle=-1.5)
    assert "door_angle = 2 is beyond the joint 'hinge'" in system.fail(door_angle=2.0)
    assert "door_angle = nan is beyond" in system.fail(door_angle=math.nan)
    assert "door_angle = 0 does not open" in system.fail(door_angle=0.0)
    system.assert_it_holds()


def test_a_second_goal_is_rejected_and_a_cancelled_one_holds_the_robot(system: System) -> None:
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


def test_a_robot_that_hides_the_door_opens_it_all_the_same(system: System) -> None:
    system.start_anew()
    first = system.send()
    system.wait_for_phase("reach", 0.2)
    system.wait(first.cancel_goal_async())
    system.result(first)
    system.graph.wait_for(lambda: system.perceived[-1].status != MorphingParameters.OK)
    assert system.set("skill_node", door_timeout=0.2).successful
    try:
        status, result = system.result(system.send())
    finally:
        assert system.set("skill_node", **PATIENT).successful
    assert result.reason == ""
    assert (status, result.success) == (GoalStatus.STATUS_SUCCEEDED, True)
    assert any("before the robot drove up" in text for text in system.log)


BAD: dict[str, dict[str, Any]] = {
    "x = 2.000 is outside": {"theta": [2.0, 0.0, 0.0]},
    "parameters are not finite": {"theta": [math.nan, 0.0, 0.0]},
    "parameters are of model 'box_a', expected 'door'": {"model": "box_a"},
    "hidden by a cat": {"status": MorphingParameters.NOT_CONVERGED, "reason": "hidden by a cat"},
}


def test_bad_parameters_of_the_door_get_a_clear_result(system: System) -> None:
    system.start_anew()
    good = system.graph.wait_for(lambda: system.perceived)[-1]
    assert system.set("sim_node", camera_rate=0.1).successful
    assert system.set("skill_node", door_timeout=0.2, max_age=600.0).successful
    try:
        for text, changes in BAD.items():
            bad = deepcopy(good)
            for field, value in changes.items():
                setattr(bad, field, value)
            system.parameters.publish(bad)
            assert text in system.fail()
        assert system.set("skill_node", max_age=0.05).successful
        system.parameters.publish(good)
        assert "the newest morphing parameters are" in system.fail()
    finally:
        assert system.set("skill_node", **PATIENT).successful
        assert system.set("sim_node", camera_rate=CAMERA_RATE).successful
    system.assert_it_holds()


def test_a_planner_that_was_killed_is_started_again(system: System) -> None:
    system.start_anew()
    handle = system.send()
    system.wait_for_phase("plan")
    for process in multiprocessing.active_children():
        assert process.pid is not None
        os.kill(process.pid, signal.SIGKILL)
    _, result = system.result(handle)
    assert result.success or "the planner's process died" in result.reason
    system.assert_it_opens()


def test_a_hand_that_another_one_opens_grasps_again(system: System) -> None:
    system.start_anew()
    handle = system.send()
    system.wait_for_phase("press")
    let_go = JointTrajectoryPoint(positions=[0.5])
    let_go.time_from_start.nanosec = 10**8
    message = JointTrajectory(joint_names=["l_gripper_l_finger_joint"], points=[let_go])
    system.feedback.clear()

    def plans_anew() -> bool:
        system.trajectory.publish(message)
        return any(feedback.phase == "plan" for feedback in system.feedback)

    system.graph.wait_for(plans_anew)
    _, result = system.result(handle)
    assert result.reason == ""
    assert result.success
    assert result.attempts >= 2
    assert system.doors[-1].position[0] < -0.8


def test_a_simulator_that_is_reset_half_way_ends_the_goal(system: System) -> None:
    system.start_anew()
    handle = system.send()
    system.wait_for_phase("reach", 0.2)
    system.wait(system.reset.call_async(Trigger.Request()))
    status, result = system.result(handle)
    assert (status, result.success) == (GoalStatus.STATUS_ABORTED, False)
    assert "jumped by" in result.reason
    system.assert_it_holds()


def test_a_simulator_that_dies_half_way_ends_the_goal_and_may_come_again(system: System) -> None:
    system.start_anew()
    handle = system.send()
    system.wait_for_phase("reach", 0.2)
    system.stop_simulator()
    status, result = system.result(handle)
    assert (status, result.success) == (GoalStatus.STATUS_ABORTED, False)
    assert "stopped" in result.reason
    assert system.sent[-1].points == []
    system.start_simulator()
    system.assert_it_opens()
