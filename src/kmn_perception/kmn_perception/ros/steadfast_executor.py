"""An executor that outlives messages which ROS itself cannot read."""

from __future__ import annotations

import os
from collections.abc import Awaitable, Callable
from traceback import walk_tb
from types import TracebackType
from typing import Any

from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

from kmn_perception.ros.reports import ThrottledWarnings

OURS = tuple(f"{os.sep}{package}{os.sep}" for package in ("kmn_perception", "kmn_sim", "kmn_skill"))

Execute = Callable[[], Awaitable[None]]


class SteadfastExecutor(SingleThreadedExecutor):
    """Executes a node's callbacks; their own errors end it, those of rclpy are warned of.

    Whoever is on the network may send a text that is not UTF-8, a parameter of an unknown type or a
    negative time. rclpy raises where it reads them, and its executor would end with the node.
    """

    def __init__(self, node: Node) -> None:
        super().__init__(context=node.context)
        self.add_node(node)
        self._warnings = ThrottledWarnings(node)

    def _take_subscription(self, sub: Any) -> Execute | None:
        return self._guarded(super()._take_subscription, sub, sub.topic_name)

    def _take_service(self, srv: Any) -> Execute | None:
        return self._guarded(super()._take_service, srv, srv.srv_name)

    def _take_client(self, client: Any) -> Execute | None:
        return self._guarded(super()._take_client, client, client.srv_name)

    def _take_waitable(self, waitable: Any) -> Execute | None:
        return self._guarded(super()._take_waitable, waitable, type(waitable).__name__)

    def _guarded(
        self, take: Callable[[Any], Execute | None], entity: Any, name: str
    ) -> Execute | None:
        """Take what has come for an entity, and return what is to be executed for it."""
        try:
            execute = take(entity)
        except Exception as error:
            self._refuse(name, error)
            return None

        async def guarded() -> None:
            try:
                if execute is not None:
                    await execute()
            except Exception as error:
                if _is_ours(error.__traceback__):
                    raise
                self._refuse(name, error)

        return guarded

    def _refuse(self, name: str, error: Exception) -> None:
        self._warnings.warn(name, f"{name}: ROS cannot read what came, and ignores it: {error}")


def _is_ours(traceback: TracebackType | None) -> bool:
    """Tell whether an error was raised in or below a callback of the project."""
    files = [frame.f_code.co_filename for frame, _ in walk_tb(traceback)]
    return any(part in file for part in OURS for file in files if file != __file__)
