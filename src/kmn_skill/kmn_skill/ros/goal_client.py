"""Who sent a goal, behind the handle that the action's server has of it."""

from __future__ import annotations

import threading
import time

from rclpy.action.server import ServerGoalHandle

from kmn_msgs.action import OpenDoor
from kmn_skill.execution.errors import InterruptedGoal
from kmn_skill.execution.goal import Feedback
from kmn_skill.ros.skill_statistics import SkillStatistics

FEEDBACK_PERIOD = 0.1  # seconds


class GoalClient:
    """Tells whether the goal is still wanted, and publishes what is being done.

    Parameters
    ----------
    closing
        Is set when the node ends.
    """

    def __init__(
        self, handle: ServerGoalHandle, closing: threading.Event, statistics: SkillStatistics
    ) -> None:
        self._handle, self._closing, self._statistics = handle, closing, statistics
        self._fed_back, self._phase = 0.0, ""

    def interruption(self) -> InterruptedGoal | None:
        """Return why the goal is not wanted any more, if it is not."""
        if self._handle.is_cancel_requested:
            return InterruptedGoal("cancelled", "the goal was cancelled")
        if self._closing.is_set():
            return InterruptedGoal("node_ended", "the node ended")
        return None

    def feed_back(self, feedback: Feedback) -> None:
        """Publish what is being done: each phase, its end, and in between once in a period."""
        now = time.monotonic()
        recent = feedback.phase == self._phase and now - self._fed_back < FEEDBACK_PERIOD
        if recent and feedback.progress < 1.0:
            return
        self._phase, self._fed_back = feedback.phase, now
        self._statistics.enter(feedback.phase)
        self._handle.publish_feedback(OpenDoor.Feedback(**feedback._asdict()))
