"""Controllers that misbehave are named, whatever they do, and the others are cancelled."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest
from control_msgs.action import FollowJointTrajectory
from rclpy.action import ActionServer, CancelResponse, GoalResponse  # type: ignore[attr-defined]
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.node import Node
from rclpy.task import Future

from graph import spinning
from kmn_perception.ros.stamps import seconds

pytest.importorskip("robotic")
from kmn_skill.execution.errors import ControllerError  # noqa: E402
from kmn_skill.execution.plan_execution import Part  # noqa: E402
from kmn_skill.planning.robot import RobotModel  # noqa: E402
from kmn_skill.ros.action_control import ActionControl  # noqa: E402
from kmn_skill.ros.locked_action_client import LockedActionClient  # noqa: E402

ROBOT = RobotModel.load("pr2")
Result = FollowJointTrajectory.Result
TIMEOUT = 2.0  # seconds, for a busy machine


class Controller:
    """Serves a controller's action as a robot would, or does something else when it is asked.

    Parameters
    ----------
    answer, execute
        What is done with a goal; both may wait.
    """

    def __init__(self, node: Node, name: str, answer: Any = None, execute: Any = None) -> None:
        self.goals: list[FollowJointTrajectory.Goal] = []
        self.cancelled = self._vanished = False
        self._node, self._answer, self._end = node, answer, Future()
        self.server = ActionServer(
            node,
            FollowJointTrajectory,
            ROBOT.controllers[name].name,
            execute or self._follow,
            goal_callback=self._take,
            cancel_callback=self._cancel,
            callback_group=ReentrantCallbackGroup(),  # one that waits must not stop the others
        )

    def succeed(self) -> None:
        """Let the goal that runs succeed."""
        self._end.set_result(None)
        assert self._node.executor is not None
        self._node.executor.wake()

    def vanish(self) -> None:
        """End the server."""
        if not self._vanished:
            self._vanished = True
            self.server.destroy()

    async def _take(self, goal: Any) -> GoalResponse:
        self.goals.append(goal)
        return await self._answer() if self._answer else GoalResponse.ACCEPT

    def _cancel(self, handle: Any) -> CancelResponse:
        self.cancelled = True
        self._end.set_result(None)
        return CancelResponse.ACCEPT

    async def _follow(self, handle: Any) -> Any:
        await self._end
        if handle.is_cancel_requested:
            handle.canceled()
        else:
            handle.succeed()
        return Result()


async def abort(handle: Any) -> Any:
    handle.abort()
    return Result(error_code=Result.PATH_TOLERANCE_VIOLATED, error_string="it is stuck")


async def reject() -> GoalResponse:
    return GoalResponse.REJECT


async def keep_silent() -> GoalResponse:
    await Future()
    return GoalResponse.REJECT


class Robot:
    """A robot with three controllers, and what controls them."""

    def __init__(self, graph: Any, **gripper: Any) -> None:
        self.graph = graph
        self.node, self.client = (Node(n, context=graph.context) for n in ("robot", "skill"))
        self.arm, self.base = (Controller(self.node, name) for name in ("arm", "base"))
        self.gripper = Controller(self.node, "gripper", **gripper)
        self.all = (self.arm, self.base, self.gripper)
        self.control = ActionControl(self.client, ROBOT, self.now, lambda: TIMEOUT)

    def now(self) -> float:
        return seconds(self.client.get_clock().now().to_msg())

    def move(self) -> None:
        """Send all joints to where they begin, within half a second."""
        self.graph.wait_for(self.control.is_ready)
        positions = np.array([ROBOT.home, ROBOT.home])
        self.control.send(
            Part(self.now() + 0.2, np.array([0.0, 0.3]), positions, np.zeros_like(positions))
        )

    def failure(self) -> str:
        """Wait until a controller fails; return how."""
        found: list[str] = []

        def fails() -> bool:
            try:
                self.control.are_through()
            except ControllerError as error:
                found.append(str(error))
            return bool(found)

        self.graph.wait_for(fails)
        return found[0]


@contextmanager
def running(graph: Any, **gripper: Any) -> Iterator[Robot]:
    robot = Robot(graph, **gripper)
    with spinning(robot.node), spinning(robot.client):
        yield robot
        robot.control.destroy()
        for each in robot.all:
            each.vanish()


def test_each_controller_gets_its_joints_all_with_the_same_stamp(graph: Any) -> None:
    with running(graph) as robot:
        robot.move()
        robot.graph.wait_for(lambda: all(each.goals for each in robot.all))
        goals = [each.goals[0] for each in robot.all]
        assert len({seconds(goal.trajectory.header.stamp) for goal in goals}) == 1
        for name, each in (("arm", robot.arm), ("base", robot.base), ("gripper", robot.gripper)):
            joints = list(ROBOT.controllers[name].joints)
            assert list(each.goals[0].trajectory.joint_names) == joints
            places = [ROBOT.joint_names.index(joint) for joint in joints]
            found = each.goals[0].trajectory.points[0].positions
            np.testing.assert_allclose(found, ROBOT.home[places])
        # It presses, and so never gets where it is sent.
        assert [t.position for t in robot.gripper.goals[0].goal_tolerance] == [-1.0]
        assert not robot.arm.goals[0].goal_tolerance
        assert not robot.control.are_through()
        for each in robot.all:
            each.succeed()
        robot.graph.wait_for(robot.control.are_through)


FAULTS: dict[str, dict[str, Any]] = {
    "rejected its goal": {"answer": reject},
    "aborted its goal, PATH_TOLERANCE_VIOLATED: it is stuck": {"execute": abort},
    "is not through": {},
    "did not answer within 2 s": {"answer": keep_silent},
}


@pytest.mark.parametrize("text", FAULTS)
def test_a_controller_that_fails_is_named_and_the_others_are_cancelled(
    graph: Any, text: str
) -> None:
    with running(graph, **FAULTS[text]) as robot:
        robot.move()
        robot.graph.wait_for(lambda: all(each.goals for each in robot.all))
        if text == "is not through":
            robot.arm.succeed()
            robot.base.succeed()
        assert robot.failure().startswith(f"the controller 'gripper' {text}")
        robot.control.hold(ROBOT.home, 0.0)
        assert robot.control.are_through()
        if text != "is not through":
            graph.wait_for(lambda: robot.arm.cancelled and robot.base.cancelled)


def test_a_controller_that_vanishes_is_named(graph: Any) -> None:
    with running(graph) as robot:
        robot.move()
        robot.graph.wait_for(lambda: all(each.goals for each in robot.all))
        robot.gripper.vanish()
        assert robot.failure() == (
            "the controller 'gripper' is not there: nobody serves "
            f"'{ROBOT.controllers['gripper'].name}'"
        )


class SlowHandle:
    """Sends as the handle of an action's client does, but returns only when answers may be there.

    Parameters
    ----------
    handle
        Which sends.
    """

    def __init__(self, handle: Any) -> None:
        self._handle = handle

    def __getattr__(self, name: str) -> Any:
        found = getattr(self._handle, name)
        if not name.startswith("send_"):
            return found

        def send(request: Any) -> int:
            number: int = found(request)
            time.sleep(0.5)
            return number

        return send


def test_an_answer_that_comes_before_it_is_noted_who_asked_is_not_lost(graph: Any) -> None:
    with running(graph) as robot:
        graph.wait_for(robot.control.is_ready)
        node = Node("slow", context=graph.context)
        with spinning(node):
            client = LockedActionClient(node, FollowJointTrajectory, ROBOT.controllers["arm"].name)
            client._client_handle = SlowHandle(client._client_handle)
            graph.wait_for(client.server_is_ready)
            sent = client.send_goal_async(FollowJointTrajectory.Goal())
            graph.wait_for(sent.done)
            ended = sent.result().get_result_async()
            cancelled = sent.result().cancel_goal_async()
            graph.wait_for(lambda: cancelled.done() and ended.done())
            client.destroy()
