"""A handle that was not seen is looked for from near, by a robot that carries its camera."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from copy import deepcopy
from typing import Any

import numpy as np
import pytest
from action_msgs.msg import GoalStatus
from builtin_interfaces.msg import Duration
from rclpy.parameter import Parameter
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

pytest.importorskip("pybullet")
pytest.importorskip("robotic")
from door_client import SPEED, DoorClient  # noqa: E402
from kmn_msgs.msg import MorphingParameters  # noqa: E402
from kmn_skill.ros.skill_node import SkillNode  # noqa: E402

DISTANCE = 1.1  # metres
PARAMETERS = {
    "use_sim_time": True,
    "look_distance": DISTANCE,
    "max_age": 20.0,
    "door_timeout": 20.0,
    "state_timeout": 1.0 * SPEED,
    "start_delay": 0.3 * SPEED,
    "part_duration": 2.0 * SPEED,
    "part_overlap": 0.4 * SPEED,
}


class Perception:
    """Tells the true door, and its handle, and that surely, only to one who stands near enough."""

    def __init__(self, client: DoorClient) -> None:
        self._client, self._over = client, threading.Event()
        self._truth: list[MorphingParameters] = []
        client.create_subscription(MorphingParameters, "ground_truth", self._truth.append, 1)
        client.graph.wait_for(lambda: self._truth)
        self.sees_handle_within, self.is_sure_within = DISTANCE + 0.1, 9.0
        self._thread = threading.Thread(target=self._publish)
        self._thread.start()

    def close(self) -> None:
        self._over.set()
        self._thread.join()

    def door(self) -> np.ndarray:
        return np.array(self._truth[-1].theta)

    def _publish(self) -> None:
        while not self._over.wait(0.1):
            message, state = deepcopy(self._truth[-1]), next(iter(self._client.joints[-1:]), None)
            if state is None:
                continue
            message.header.stamp = state.header.stamp
            distance = np.linalg.norm(self.door()[:2] - state.position[:2])
            if distance > self.sees_handle_within:
                message.status = MorphingParameters.HANDLE_NOT_SEEN
                message.reason = "no handle is seen"
            elif distance > self.is_sure_within:
                count = len(message.theta) + len(message.gamma)
                message.covariance = (0.033**2 * np.eye(count)).ravel().tolist()
            self._client.parameters.publish(message)


@pytest.fixture(scope="module")
def system(graph: Any) -> Iterator[DoorClient]:
    made = graph.start(lambda **_: DoorClient(graph))
    made.start_simulator()
    overrides = [Parameter(name, value=value) for name, value in PARAMETERS.items()]
    graph.start(SkillNode, parameter_overrides=overrides)
    assert made.action.wait_for_server(30.0)
    yield made
    made.stop_simulator()


@pytest.fixture(scope="module")
def perception(system: DoorClient) -> Iterator[Perception]:
    made = Perception(system)
    yield made
    made.close()


def test_the_robot_drives_to_where_it_sees_the_handle_and_opens_the_door(
    system: DoorClient, perception: Perception
) -> None:
    handle = system.send()
    system.wait_for_phase("plan")
    base = system.state()[1][:3]
    x, y, yaw = perception.door()
    assert base == pytest.approx(
        (x - DISTANCE * np.cos(yaw), y - DISTANCE * np.sin(yaw), yaw), abs=0.02
    )
    status, result = system.result(handle)
    assert result.reason == ""
    assert status == GoalStatus.STATUS_SUCCEEDED
    phases = list(dict.fromkeys(feedback.phase for feedback in system.feedback))
    assert phases == ["wait", "look", "plan", "reach", "grasp", "press", "open"]
    assert any("looking from near" in text for text in system.log)
    system.wait_for_door(result.door_angle)


def test_a_handle_that_is_not_seen_from_near_either_is_not_grasped(
    system: DoorClient, perception: Perception
) -> None:
    perception.sees_handle_within = 0.0
    system.start_anew()
    assert system.set(door_timeout=3.0).successful
    assert "no handle is seen" in system.fail()
    phases = list(dict.fromkeys(feedback.phase for feedback in system.feedback))
    assert phases == ["wait", "look"]
    system.assert_it_holds()


def test_a_handle_that_is_not_known_well_enough_is_looked_at_from_nearer(
    system: DoorClient, perception: Perception
) -> None:
    perception.sees_handle_within, perception.is_sure_within = 9.0, DISTANCE - 0.1
    system.start_anew()
    assert system.set(look_nearer=0.85, door_timeout=20.0).successful
    handle = system.send()
    system.wait_for_phase("plan")
    x, y, _ = perception.door()
    base = np.hypot(*(system.state()[1][:2] - [x, y]))
    assert base == pytest.approx(0.85 * DISTANCE, abs=0.02)
    system.wait(handle.cancel_goal_async())
    assert system.result(handle)[0] == GoalStatus.STATUS_CANCELED


def test_a_handle_that_is_known_well_enough_from_nowhere_is_not_grasped(
    system: DoorClient, perception: Perception
) -> None:
    perception.is_sure_within = 0.0
    system.start_anew()
    assert system.set(looks=2, look_patience=0.2, door_timeout=1.0).successful
    reason = system.fail()
    assert "the standard deviation of the handle is 0.0" in reason
    assert "looked from 1.10, 0.94 m before it" in reason
    phases = list(dict.fromkeys(feedback.phase for feedback in system.feedback))
    assert phases == ["wait", "look"]
    system.assert_it_holds()
    perception.is_sure_within = 9.0


def test_a_robot_that_looks_first_does_so_though_it_sees_the_handle_from_afar(
    system: DoorClient, perception: Perception
) -> None:
    perception.sees_handle_within = 9.0
    system.start_anew()
    assert system.set(look_first=True, door_timeout=40.0).successful
    handle = system.send()
    system.wait_for_phase("plan")
    x, y, _ = perception.door()
    assert np.hypot(*(system.state()[1][:2] - [x, y])) == pytest.approx(DISTANCE, abs=0.02)
    system.wait(handle.cancel_goal_async())
    assert system.result(handle)[0] == GoalStatus.STATUS_CANCELED
    assert system.set(look_first=False).successful


def test_a_robot_at_a_door_of_which_nothing_is_known_draws_back(
    system: DoorClient, perception: Perception
) -> None:
    """As after a restart without a memory: so near, it may hide the door."""
    perception.sees_handle_within = 9.0
    system.start_anew()
    x, y, yaw = perception.door()
    positions = system.state()[1].tolist()
    positions[:3] = x - 0.6 * np.cos(yaw), y - 0.6 * np.sin(yaw), yaw
    point = JointTrajectoryPoint(positions=positions, time_from_start=Duration(sec=8))
    names = list(system.joints[-1].name)
    system.trajectory.publish(JointTrajectory(joint_names=names, points=[point]))
    system.graph.wait_for(lambda: np.allclose(system.state()[1][:3], positions[:3], atol=0.005))
    handle = system.send()
    system.wait_for_phase("plan")
    assert np.hypot(*(system.state()[1][:2] - [x, y])) == pytest.approx(DISTANCE, abs=0.02)
    _, result = system.result(handle)
    assert result.reason == ""
    assert any("may hide it; drawing back" in text for text in system.log)


def test_a_door_too_near_to_look_at_is_refused(system: DoorClient, perception: Perception) -> None:
    perception.sees_handle_within = 0.0
    system.start_anew()
    assert system.set(look_distance=0.2).successful
    assert "to see the handle the robot would come within" in system.fail()
    system.assert_it_holds()
