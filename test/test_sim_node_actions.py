"""sim_node serves FollowJointTrajectory for each controller as the stock controller does."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from action_msgs.msg import GoalStatus
from control_msgs.action import FollowJointTrajectory
from control_msgs.msg import JointTolerance
from rclpy.parameter import Parameter
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory

from kmn_perception.ros.stamps import duration_of, seconds, stamp_of
from sim_client import SimClient, time_to_rest, trajectory

pytest.importorskip("pybullet")
from kmn_sim.robot.settings import RobotSettings  # noqa: E402
from kmn_sim.ros.sim_node import SimNode  # noqa: E402
from kmn_skill.ros.locked_action_client import LockedActionClient  # noqa: E402

CONTROLLERS = RobotSettings.load().controllers
ARM = list(CONTROLLERS["arm"].joints)
Result = FollowJointTrajectory.Result
SUCCEEDED, CANCELED, ABORTED = (
    GoalStatus.STATUS_SUCCEEDED,
    GoalStatus.STATUS_CANCELED,
    GoalStatus.STATUS_ABORTED,
)


class ActionUser(SimClient):
    """Sends goals to the controllers of arm and gripper."""

    def __init__(self, graph: Any) -> None:
        super().__init__(graph)
        self.arm, self.gripper = (
            LockedActionClient(
                self, FollowJointTrajectory, f"l_{part}_controller/follow_joint_trajectory"
            )
            for part in ("arm", "gripper")
        )
        self.feedback: list[FollowJointTrajectory.Feedback] = []

    def send(
        self, message: JointTrajectory, client: LockedActionClient | None = None, **more: Any
    ) -> Any:
        """Send a goal; return its handle."""
        self.feedback.clear()
        goal = FollowJointTrajectory.Goal(trajectory=message, **more)
        return self.wait(
            (client or self.arm).send_goal_async(
                goal, lambda message: self.feedback.append(message.feedback)
            )
        )

    def end(self, handle: Any) -> tuple[int, int, str]:
        """Wait for the result of a goal: status, code and text."""
        assert handle.accepted
        answer = self.wait(handle.get_result_async())
        return answer.status, answer.result.error_code, answer.result.error_string

    def arm_at(self, offset: float, duration: float = 1.0) -> JointTrajectory:
        """Return a trajectory that turns the shoulder by an angle."""
        positions = [self.position(name) for name in ARM]
        return trajectory((duration, positions[0] + offset, *positions[1:]), names=ARM)


@pytest.fixture(scope="module")
def user(graph: Any) -> ActionUser:
    slow = [Parameter("publish_clock", value=True), Parameter("camera_rate", value=0.1)]
    graph.start(SimNode, parameter_overrides=[*slow, Parameter("real_time_factor", value=1.0)])
    made = graph.start(lambda **_: ActionUser(graph))
    assert made.arm.wait_for_server(30.0)
    assert made.gripper.wait_for_server(30.0)
    made.graph.wait_for(lambda: made.joints)
    return made


@pytest.fixture(autouse=True)
def at_rest(user: ActionUser) -> None:
    user.call(user.reset, Trigger.Request())
    user.joints.clear()
    user.graph.wait_for(lambda: user.joints)


def test_a_goal_that_is_followed_succeeds_and_tells_where_the_joints_are(user: ActionUser) -> None:
    target = user.position(ARM[0]) - 0.5
    tolerance = [JointTolerance(name=ARM[0], position=0.02)]
    handle = user.send(user.arm_at(-0.5), goal_tolerance=tolerance, path_tolerance=tolerance)
    assert user.end(handle) == (SUCCEEDED, Result.SUCCESSFUL, "")
    assert user.position(ARM[0]) == pytest.approx(target, abs=0.03)
    assert len(user.feedback) > 5
    feedback = user.feedback[-1]
    assert list(feedback.joint_names) == ARM
    error = np.subtract(feedback.desired.positions, feedback.actual.positions)
    np.testing.assert_allclose(feedback.error.positions, error)


def in_the_past(message: JointTrajectory) -> JointTrajectory:
    message.header.stamp.nanosec = 1
    return message


@pytest.mark.parametrize(
    ("reason", "message"),
    [
        ("empty", JointTrajectory(joint_names=ARM)),
        ("unknown_joint", trajectory((1.0, *8 * [0.0]), names=[*ARM, "base_x"])),
        ("partial", trajectory((1.0, 0.0), names=ARM[:1])),
        ("times", trajectory((1.0, *7 * [0.0]), (0.5, *7 * [0.0]), names=ARM)),
        ("in_the_past", in_the_past(trajectory((0.1, *7 * [0.0]), names=ARM))),
    ],
)
def test_a_wrong_goal_is_rejected_and_what_runs_goes_on(
    user: ActionUser, reason: str, message: JointTrajectory
) -> None:
    running = user.send(user.arm_at(0.2, 0.5))
    assert not user.send(message).accepted
    assert user.end(running)[:2] == (SUCCEEDED, Result.SUCCESSFUL)
    assert f"refused_{reason}" in user.report()


def test_a_new_goal_ends_the_one_that_runs(user: ActionUser) -> None:
    first = user.send(user.arm_at(1.0, 5.0))
    second = user.send(user.arm_at(-0.2, 0.5))
    status, code, text = user.end(first)
    assert (status, code) == (ABORTED, Result.INVALID_GOAL)
    assert "preempted" in text
    assert user.end(second)[0] == SUCCEEDED


def test_controllers_do_not_disturb_each_other_but_the_topic_takes_all_over(
    user: ActionUser,
) -> None:
    arm = user.send(user.arm_at(0.5, 3.0))
    gripper = ["l_gripper_l_finger_joint"]
    assert user.end(user.send(trajectory((0.3, 0.3), names=gripper), user.gripper))[0] == SUCCEEDED
    newest = user.joints[-1]
    user.trajectory.publish(trajectory((0.5, *newest.position), names=newest.name))
    assert user.end(arm)[:2] == (ABORTED, Result.INVALID_GOAL)


def test_a_cancelled_goal_holds_the_robot_within_0_2_s(user: ActionUser) -> None:
    assert user.set(real_time_factor=0.2).successful  # so that messages take little of its time
    try:
        handle = user.send(user.arm_at(-1.0))
        user.graph.wait_for(lambda: np.abs(user.joints[-1].velocity).max() > 0.5)
        since = seconds(user.joints[-1].header.stamp)
        user.wait(handle.cancel_goal_async())
        assert user.end(handle)[0] == CANCELED
        user.graph.wait_for(lambda: seconds(user.joints[-1].header.stamp) > since + 0.6)
    finally:
        assert user.set(real_time_factor=1.0).successful
    assert time_to_rest(user.joints, since) < 0.2


@pytest.mark.parametrize(
    ("code", "options"),
    [
        (
            Result.PATH_TOLERANCE_VIOLATED,
            {"path_tolerance": [JointTolerance(name=ARM[0], position=1e-6)]},
        ),
        (
            Result.GOAL_TOLERANCE_VIOLATED,
            {
                "goal_tolerance": [JointTolerance(name=ARM[0], position=1e-12)],
                "goal_time_tolerance": duration_of(0.1),
            },
        ),
    ],
)
def test_a_goal_that_misses_its_tolerances_is_aborted_and_the_joint_named(
    user: ActionUser, code: int, options: dict[str, Any]
) -> None:
    status, found, text = user.end(user.send(user.arm_at(-0.5, 0.3), **options))
    assert (status, found) == (ABORTED, code)
    assert f"{ARM[0]} is off by" in text


def test_a_goal_ends_with_the_world_that_it_was_for(user: ActionUser) -> None:
    handle = user.send(user.arm_at(0.5, 5.0))
    user.call(user.reset, Trigger.Request())
    assert user.end(handle)[:2] == (ABORTED, Result.INVALID_GOAL)


def test_a_start_in_the_future_is_the_same_for_all_controllers(user: ActionUser) -> None:
    """They are through 1 s after their stamp, whenever their goals came."""
    message = user.arm_at(-0.3, 0.5)
    message.header.stamp = stamp_of(seconds(user.joints[-1].header.stamp) + 0.5)
    assert user.end(user.send(message))[0] == SUCCEEDED
    passed = seconds(user.joints[-1].header.stamp) - seconds(message.header.stamp)
    assert 0.4 < passed < 1.0
