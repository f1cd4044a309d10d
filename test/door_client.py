"""A client of the whole system: it sends goals, and sees what becomes of them."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from typing import Any

import numpy as np
from action_msgs.msg import GoalStatus
from numpy.typing import NDArray
from rcl_interfaces.msg import SetParametersResult
from rcl_interfaces.srv import SetParametersAtomically
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory
from visualization_msgs.msg import Marker, MarkerArray

from graph import TIMEOUT, GraphClient
from kmn_msgs.action import OpenDoor
from kmn_msgs.msg import MorphingParameters
from kmn_perception.ros.parameters import request_to_set
from kmn_perception.ros.stamps import seconds
from kmn_sim.ros.sim_node import SimNode
from kmn_skill.ros.locked_action_client import LockedActionClient
from sim_client import STILL, time_to_rest

SEED = 3  # of a door that is wholly in view
SPEED = 2.0  # simulated seconds in one second
CAMERA_RATE = 0.5  # frames a simulated second
ALL = 1000  # messages that wait on a busy machine; of states only the newest one does
SILENCE = 2.0  # seconds after which a slow machine has perceived all
DISCOVERY = 1.0  # seconds until both sides of a service know each other: an answer may get lost
SETTLING = 4.0  # simulated seconds in which a robot that holds comes to rest
# With so slow a camera and so fast a clock.
PATIENT = {
    "min_consistent_frames": 2,
    "max_age": 20.0,
    "door_timeout": 40.0,
    "state_timeout": 1.0 * SPEED,
    "start_delay": 0.3 * SPEED,
    "part_duration": 2.0 * SPEED,
    "part_overlap": 0.4 * SPEED,
    "controller_timeout": 2.0 * SPEED,
}
RELAYED = "relayed_joint_states"  # which a test may hold back
PULL = {"handle_angle": -0.7, "door_angle": -0.9}


class DoorClient(GraphClient):
    """Starts and stops the simulator, sends goals, and keeps what the nodes publish."""

    def __init__(self, graph: Any) -> None:
        super().__init__(graph, "skill_node")
        self.joints: list[JointState] = []
        self.doors: list[JointState] = []
        self.sent: list[JointTrajectory] = []
        self.paths: list[list[Marker]] = []
        self.feedback: list[OpenDoor.Feedback] = []
        self.perceived: list[MorphingParameters] = []
        self.relays = True  # the states of the robot, to which skill_node listens
        self._relay = self.create_publisher(JointState, RELAYED, 1)
        self.create_subscription(JointState, "joint_states", self._on_joints, 1)
        for kind, name, kept, depth in (
            (JointState, "door_state", self.doors, 1),
            (JointTrajectory, "joint_trajectory", self.sent, ALL),
            (MorphingParameters, "morphing_parameters", self.perceived, ALL),
        ):
            self.create_subscription(kind, name, kept.append, depth)
        self.create_subscription(MarkerArray, "planned_path", self._keep_path, 10)
        self.parameters = self.create_publisher(MorphingParameters, "morphing_parameters", 10)
        self.trajectory = self.create_publisher(JointTrajectory, "joint_trajectory", 10)
        self.reset = self.create_client(Trigger, "reset")
        self.action = LockedActionClient(
            self, OpenDoor, "open_door", feedback_sub_qos_profile=QoSProfile(depth=ALL)
        )
        self._simulator_setting = self.create_client(
            SetParametersAtomically, "sim_node/set_parameters_atomically"
        )
        self._simulator = ExitStack()

    def _on_joints(self, message: JointState) -> None:
        self.joints.append(message)
        if self.relays:
            self._relay.publish(message)

    def _keep_path(self, message: MarkerArray) -> None:
        self.paths.append(message.markers)

    def start_simulator(self, robot: str = "pr2", model: str = "door") -> None:
        """Start a simulator, in which a robot and an object stand where they start."""
        overrides = [
            Parameter("real_time_factor", value=SPEED),
            Parameter("publish_clock", value=True),
            Parameter("placement", value="random"),
            Parameter("seed", value=SEED),
            Parameter("camera_rate", value=CAMERA_RATE),
            Parameter("robot", value=robot),
            Parameter("model", value=model),
        ]
        self._simulator.enter_context(self.graph.running(SimNode, parameter_overrides=overrides))
        self.joints.clear()
        self.graph.wait_for(lambda: self.joints and self.doors)

    def stop_simulator(self) -> None:
        self._simulator.close()

    @contextmanager
    def pace(self, factor: float) -> Iterator[None]:
        """Run the simulator at another real-time factor.

        A slow one leaves time for a cancellation to come before the robot is elsewhere.
        """
        assert self.set_simulator(real_time_factor=factor).successful
        try:
            yield
        finally:
            assert self.set_simulator(real_time_factor=SPEED).successful

    def set_simulator(self, **values: Any) -> SetParametersResult:
        """Set parameters of the simulator, all or none."""
        return self.call(self._simulator_setting, request_to_set(values)).result

    def wait_for_server(self) -> None:
        """Wait for a node that has just started; it comes to know this client a little later."""
        assert self.action.wait_for_server(TIMEOUT)
        time.sleep(DISCOVERY)

    def send(self, **angles: float) -> Any:
        """Send a goal, and return its handle."""
        self.feedback.clear()
        self.sent.clear()
        goal = OpenDoor.Goal(**{**PULL, **angles})
        self.goal = self.send_goal(self.action, goal, lambda m: self.feedback.append(m.feedback))
        return self.goal

    def result(self, handle: Any) -> tuple[int, OpenDoor.Result]:
        answer = self.wait(handle.get_result_async())
        return answer.status, answer.result

    def fail(self, **angles: float) -> str:
        """Send a goal that must end without success, and return the reason."""
        status, result = self.result(self.send(**angles))
        assert (status, result.success) == (GoalStatus.STATUS_ABORTED, False)
        return str(result.reason)

    def wait_for_phase(self, phase: str, progress: float = 0.0) -> None:
        """Wait until the goal was in a phase; fail at once if it ends before."""

        def is_there() -> bool:
            there = any(f.phase == phase and f.progress >= progress for f in self.feedback)
            ended = self.goal.status > GoalStatus.STATUS_CANCELING
            assert there or not ended, f"the goal ended before {phase}, {progress:.0%}"
            return there

        self.graph.wait_for(is_there)

    def state(self) -> tuple[float, NDArray[np.float64]]:
        """Wait for a state, and return its time (s) and the robot's positions."""
        self.joints.clear()
        newest = self.graph.wait_for(lambda: self.joints)[-1]
        return seconds(newest.header.stamp), np.array(newest.position)

    def wait_for_door(self, angle: float) -> None:
        """Wait until the door is told to stand at an angle; its states may come late."""
        self.graph.wait_for(lambda: abs(self.doors[-1].position[0] - angle) < 0.05)

    def start_anew(self) -> None:
        """Put the robot and the door where they start, and wait until the door was seen there."""
        assert self.call(self.reset, Trigger.Request()).success
        self.joints.clear()
        now = seconds(self.graph.wait_for(lambda: self.joints)[-1].header.stamp)
        self.graph.wait_for(
            lambda: self.perceived and seconds(self.perceived[-1].header.stamp) > now
        )

    def wait_until_no_more_is_perceived(self) -> None:
        """Wait until what was exposed before is perceived, too."""
        count = -1
        while len(self.perceived) > count:
            count = len(self.perceived)
            time.sleep(SILENCE)

    def assert_it_opens(self) -> None:
        """Assert that the door opens from its start."""
        self.start_anew()
        status, result = self.result(self.send())
        assert result.reason == ""
        assert (status, result.success) == (GoalStatus.STATUS_SUCCEEDED, True)
        assert result.door_angle < -0.8
        self.wait_for_door(result.door_angle)

    def wait_for_hold(self) -> None:
        """Wait until the last thing sent is to hold; it may come later than the result."""
        self.graph.wait_for(lambda: self.sent and len(self.sent[-1].points) == 1)

    def assert_it_stops(self, since: float, within: float) -> None:
        """Assert that all joints come to rest within some seconds of a simulated time."""
        self.graph.wait_for(lambda: seconds(self.joints[-1].header.stamp) > since + within + 0.3)
        before = [s for s in self.joints if seconds(s.header.stamp) <= since]
        assert np.abs(before[-1].velocity).max() > 5.0 * STILL
        assert time_to_rest(self.joints, since) < within

    def assert_it_holds(self) -> None:
        """Assert that the last thing sent was to hold, and that the robot comes to rest."""
        self.wait_for_hold()
        since, before = self.state()
        while True:
            time.sleep(0.3)
            now, after = self.state()
            if np.abs(after - before)[:10].max() < 0.01:
                return
            assert now < since + SETTLING, f"it still moves: {before[:10]}, {after[:10]}"
            before = after


class TrueDoorClient(DoorClient):
    """Tells skill_node the true door in the place of perception."""

    def __init__(self, graph: Any) -> None:
        super().__init__(graph)
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self.create_subscription(
            MorphingParameters, "ground_truth", self.parameters.publish, latched
        )
