"""What the actions of all controllers have in common."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any, ClassVar

from rclpy.action.server import ActionServer, CancelResponse, GoalResponse, ServerGoalHandle
from rclpy.node import Node
from rclpy.task import Future

from kmn_sim.control.trajectory import TrajectoryError
from kmn_sim.control.trajectory_goal import Ending, Goal, Outcome
from kmn_sim.ros.trajectory_input import TrajectoryInput
from kmn_sim.world.simulation import Simulation


class ControllerAction(ABC):
    """Rejects wrong goals; a new goal ends the former one as aborted; to cancel is to hold.

    Parameters
    ----------
    name, action
        Of the controller and of its action.
    """

    kind: ClassVar[Any]  # type of the action

    def __init__(self, node: Node, trajectories: TrajectoryInput, name: str, action: str) -> None:
        self._node, self._trajectories, self._name = node, trajectories, name
        self._goals: dict[bytes, tuple[ServerGoalHandle, Goal]] = {}
        self._server = ActionServer(
            node,
            self.kind,
            action,
            self._execute,
            goal_callback=self._on_goal,
            cancel_callback=self._on_cancel,
        )

    @abstractmethod
    def check(self, simulation: Simulation, request: Any) -> None:
        """Raise ``TrajectoryError`` if a goal is wrong."""

    @abstractmethod
    def accept(
        self, simulation: Simulation, request: Any, finish: Callable[[Outcome], None]
    ) -> Goal:
        """Let the controller pursue a goal; raise ``TrajectoryError`` if it is wrong."""

    @abstractmethod
    def result(self, simulation: Simulation, outcome: Outcome) -> Any:
        """Make the result of a goal that ended."""

    @abstractmethod
    def feedback(self, simulation: Simulation) -> Any:
        """Make the feedback of the present."""

    def end_goals(self, reason: str) -> None:
        """End the goals that run."""
        for _, goal in list(self._goals.values()):
            goal.finish(Outcome(Ending.PREEMPTED, reason))

    def destroy(self) -> None:
        """End the action's server."""
        self._server.destroy()

    def feed_back(self, simulation: Simulation) -> None:
        """Tell the clients of goals where the joints are, and where they should be."""
        for handle, _ in list(self._goals.values()):
            handle.publish_feedback(self.feedback(simulation))

    def _on_goal(self, request: Any) -> GoalResponse:
        refused = self._trajectories.take(lambda simulation: self.check(simulation, request))
        return GoalResponse.REJECT if refused else GoalResponse.ACCEPT

    def _on_cancel(self, handle: ServerGoalHandle) -> CancelResponse:
        if _key(handle) in self._goals:
            _, goal = self._goals[_key(handle)]
            self._trajectories.runner.call(
                lambda world: world.controllers.cancel(
                    self._name, goal, world.robot.state(), world.time
                )
            )
        return CancelResponse.ACCEPT

    async def _execute(self, handle: ServerGoalHandle) -> Any:
        """Pursue a goal; meanwhile the executor goes on."""
        executor = self._node.executor
        assert executor is not None
        done = Future()
        done.add_done_callback(lambda _: executor.wake())

        def accept(simulation: Simulation) -> None:
            goal = self.accept(simulation, handle.request, done.set_result)
            self._goals[_key(handle)] = handle, goal

        outcome = Outcome(Ending.CANCELLED, "cancelled before it began")
        if not handle.is_cancel_requested:
            try:
                self._trajectories.runner.call(accept)
                outcome = await done
                del self._goals[_key(handle)]
            except TrajectoryError as error:  # in the meantime it came to lie in the past
                outcome = Outcome(Ending.PREEMPTED, str(error))
        if outcome.ending is Ending.SUCCESSFUL:
            handle.succeed()
        elif outcome.ending is Ending.CANCELLED:
            handle.canceled()
        else:
            handle.abort()
        return self._trajectories.runner.call(lambda world: self.result(world, outcome))


def _key(handle: ServerGoalHandle) -> bytes:
    return bytes(handle.goal_id.uuid)
