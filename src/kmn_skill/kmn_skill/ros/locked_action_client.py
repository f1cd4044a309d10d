"""An action's client that may be used in any thread."""

from __future__ import annotations

from threading import RLock
from typing import Any

from rclpy.action import ActionClient  # type: ignore[attr-defined]
from rclpy.task import Future


class LockedActionClient(ActionClient):
    """Looks at an answer only once it is noted who asked.

    rclpy sends a request and then notes who waits for its answer; an answer that the executor's
    thread takes in between is dropped, and is waited for in vain.
    """

    def __init__(self, *arguments: Any, **options: Any) -> None:
        self._noting = RLock()
        super().__init__(*arguments, **options)

    def send_goal_async(self, *arguments: Any, **options: Any) -> Future:
        """Send a goal, and return the future of its handle."""
        with self._noting:
            return super().send_goal_async(*arguments, **options)

    async def execute(self, taken_data: Any) -> None:
        """Take what has come."""
        with self._noting:
            pass
        await super().execute(taken_data)

    def _cancel_goal_async(self, goal_handle: Any) -> Future:
        with self._noting:
            return super()._cancel_goal_async(goal_handle)

    def _get_result_async(self, goal_handle: Any) -> Future:
        with self._noting:
            return super()._get_result_async(goal_handle)
