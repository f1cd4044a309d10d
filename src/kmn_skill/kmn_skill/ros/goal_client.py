"""Who sent a goal, behind the handle that the action's server has of it."""

from __future__ import annotations

import time
from collections.abc import Sequence

from rclpy.action.server import ServerGoalHandle

from kmn_skill.execution.errors import InterruptedGoal, Reason
from kmn_skill.execution.goal import Feedback
from kmn_skill.ros.goal_interfaces import GoalInterface
from kmn_skill.ros.skill_statistics import SkillStatistics

FEEDBACK_PERIOD = 0.1  # seconds


class Unwanted:
    """Whether something ends goals from outside, and why; may be set in any thread.

    Attributes
    ----------
    reason
        Why goals are to end; None as long as they are not.
    """

    def __init__(self) -> None:
        self.reason: InterruptedGoal | None = None
        self._taken = False

    def set(self, reason: Reason, text: str) -> None:
        """End the goals; the first reason counts."""
        self.reason = self.reason or InterruptedGoal(reason, text)

    def take(self) -> bool:
        """Tell whether no goal has taken it yet, and take it."""
        taken, self._taken = self._taken, True
        return not taken


class GoalClient:
    """Tells whether the goal is still wanted, and publishes what is being done.

    Parameters
    ----------
    interface
        The action by which the goal came.
    unwanted
        What may end the goal from outside.
    """

    def __init__(
        self,
        handle: ServerGoalHandle,
        interface: GoalInterface,
        unwanted: Sequence[Unwanted],
        statistics: SkillStatistics,
    ) -> None:
        self._interface = interface
        self._handle, self._unwanted, self._statistics = handle, unwanted, statistics
        self._fed_back, self._phase = 0.0, ""

    def interruption(self) -> InterruptedGoal | None:
        """Return why the goal is not wanted any more, if it is not."""
        if self._handle.is_cancel_requested:
            return InterruptedGoal("cancelled", "the goal was cancelled")
        return next((each.reason for each in self._unwanted if each.reason), None)

    def feed_back(self, feedback: Feedback) -> None:
        """Publish what is being done: each phase, its end, and in between once in a period."""
        now = time.monotonic()
        recent = feedback.phase == self._phase and now - self._fed_back < FEEDBACK_PERIOD
        if recent and feedback.progress < 1.0:
            return
        self._phase, self._fed_back = feedback.phase, now
        self._statistics.enter(feedback.phase)
        self._handle.publish_feedback(self._interface.feedback(feedback))
