"""Messages that were lost on their way, by the numbers that their publishers gave them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any


class MessageGaps:
    """Counts what is missing between the messages of each topic.

    Attributes
    ----------
    lost
        Number of messages that are missing so far.
    """

    def __init__(self) -> None:
        self.lost = 0
        self._newest: dict[str, int] = {}

    def add(self, topic: str, info: Mapping[str, Any]) -> int:
        """Return how many messages are missing between this one and the one before.

        Parameters
        ----------
        info
            What rclpy tells of the message.
        """
        number = info["publication_sequence_number"]
        missing = max(0, number - self._newest.get(topic, number) - 1)
        self._newest[topic] = number
        self.lost += missing
        return missing
