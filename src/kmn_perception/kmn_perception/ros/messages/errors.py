"""What is wrong with a message."""

from __future__ import annotations


class MessageError(ValueError):
    """A message that cannot be used; the text says what was found and what was expected.

    Attributes
    ----------
    reason
        Short key to count it by, e.g. ``truncated``.
    """

    def __init__(self, reason: str, text: str) -> None:
        super().__init__(text)
        self.reason = reason
