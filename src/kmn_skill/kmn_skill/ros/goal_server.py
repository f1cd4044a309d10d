"""Serves the actions: one goal at a time, each in a thread of its own."""

from __future__ import annotations

import threading
import time
import traceback
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

from rclpy.action.server import ActionServer, CancelResponse, GoalResponse, ServerGoalHandle
from rclpy.node import Node
from rclpy.task import Future

from kmn_perception.ros.reports import ThrottledWarnings
from kmn_skill.execution.errors import GoalError
from kmn_skill.execution.goal import SUCCESS, Goal, Result
from kmn_skill.ros.goal_client import GoalClient, Unwanted
from kmn_skill.ros.goal_interfaces import GoalInterface
from kmn_skill.ros.skill_statistics import SkillStatistics

POLL_PERIOD = 0.05  # seconds
GOAL_TIMEOUT = 10.0  # seconds in which a goal ends when the node does
FAREWELL = 0.5  # seconds in which its client then may ask for the result


class GoalServer:
    """Accepts goals, lets them be pursued, and tells how they ended.

    Parameters
    ----------
    interfaces
        The actions by which goals come.
    pursue
        Pursues a goal to its result.
    statistics, warnings
        Of the node.
    preempts
        Tells whether a new goal ends the one that runs; otherwise it is rejected.
    """

    def __init__(
        self,
        node: Node,
        interfaces: Sequence[GoalInterface],
        pursue: Callable[[Goal, GoalClient], Result],
        statistics: SkillStatistics,
        warnings: ThrottledWarnings,
        preempts: Callable[[], bool],
    ) -> None:
        self._node, self._pursue = node, pursue
        self._statistics, self._warnings, self._preempts = statistics, warnings, preempts
        self._accepted: list[Unwanted] = []  # goals that have not ended, the newest one last
        self._ending = Unwanted()  # of the node
        self._workers: list[threading.Thread] = []
        self._servers = [
            ActionServer(
                node,
                interface.type,
                interface.name,
                partial(self._execute, interface),
                goal_callback=self._on_goal,
                cancel_callback=lambda _: CancelResponse.ACCEPT,
            )
            for interface in interfaces
        ]

    def close(self) -> None:
        """Let the robot hold and the clients of goals get their results.

        Meanwhile the executor must go on.
        """
        self._ending.set("node_ended", "the node ended")
        if self._accepted:
            deadline = time.monotonic() + GOAL_TIMEOUT
            while self._accepted and time.monotonic() < deadline:
                time.sleep(POLL_PERIOD)
            time.sleep(FAREWELL)

    def destroy(self) -> None:
        """End the goals and the actions, of which the node does not know."""
        self._ending.set("node_ended", "the node ended")
        for worker in self._workers:
            worker.join()
        for server in self._servers:
            server.destroy()

    def _on_goal(self, request: Any) -> GoalResponse:
        """Accept a goal if it may be pursued; whether it can be reached is for its result."""
        if self._ending.reason is None and (not self._accepted or self._preempts()):
            for unwanted in self._accepted:
                unwanted.set("preempted", "a newer goal took its place")
            self._accepted.append(Unwanted())
            return GoalResponse.ACCEPT
        text = "goal rejected: another one runs, which must end or be cancelled first"
        self._statistics.reject(text)
        self._warnings.warn("rejected", text)
        return GoalResponse.REJECT

    async def _execute(self, interface: GoalInterface, goal_handle: ServerGoalHandle) -> Any:
        """Pursue a goal in a thread, so that the executor goes on meanwhile."""
        executor = self._node.executor
        assert executor is not None
        unwanted = next(each for each in self._accepted if each.take())
        done = Future()
        done.add_done_callback(lambda _: executor.wake())
        before = self._workers[-1:]
        arguments = (interface, goal_handle, unwanted, before, done)
        worker = threading.Thread(target=self._work, args=arguments, name="goal")
        self._workers = [*(each for each in self._workers if each.is_alive()), worker]
        worker.start()
        result: Result = await done
        self._accepted.remove(unwanted)
        return interface.result(result)

    def _work(
        self,
        interface: GoalInterface,
        goal_handle: ServerGoalHandle,
        unwanted: Unwanted,
        before: Sequence[threading.Thread],
        done: Future,
    ) -> None:
        client = GoalClient(goal_handle, interface, (self._ending, unwanted), self._statistics)
        result = Result("internal_error", "the goal did not begin")
        try:
            for worker in before:  # one goal at a time, in the order in which they came
                worker.join()
            result = self._try(lambda: interface.goal(goal_handle.request), client)
            self._finish(goal_handle, result)
        finally:
            done.set_result(result)

    def _try(self, goal: Callable[[], Goal], client: GoalClient) -> Result:
        try:
            return self._pursue(goal(), client)
        except GoalError as error:
            return Result(error.reason, str(error))
        except Exception as error:  # a node never dies of a goal
            self._node.get_logger().error(traceback.format_exc())
            return Result("internal_error", repr(error))

    def _finish(self, goal_handle: ServerGoalHandle, result: Result) -> None:
        self._statistics.finish(result)
        logger = self._node.get_logger()
        if result.outcome == SUCCESS:
            logger.info(f"it is open by {result.opened:.2f} [m, rad]")
            goal_handle.succeed()
            return
        logger.warning(f"it was not opened, {result.outcome}: {result.reason}")
        if goal_handle.is_cancel_requested:
            goal_handle.canceled()
        else:
            goal_handle.abort()
