"""Warnings about a state that may last: they are given when it changes, not as long as it lasts."""

from __future__ import annotations

from rclpy.node import Node

from kmn_perception.ros.reports import ThrottledWarnings


class ChangeWarnings:
    """Logs why messages are refused when the reason changes; diagnostics tell that it lasts.

    A reason that comes and goes is said again, but not more often than `ThrottledWarnings` does.
    """

    def __init__(self, node: Node) -> None:
        self._throttled = ThrottledWarnings(node)
        self._present: dict[str, str] = {}

    def warn(self, subject: str, reason: str, text: str) -> None:
        """Log a warning, unless this was the last reason already.

        Parameters
        ----------
        subject
            What it is about, e.g. a topic.
        reason
            Key that stays the same while the text may change.
        """
        if self._present.get(subject) != reason:
            self._present[subject] = reason
            self._throttled.warn(f"{subject} {reason}", text)

    def clear(self, subject: str) -> None:
        """Note that all is well with a subject."""
        self._present.pop(subject, None)
