"""Buttons and sliders of the page."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Any

import viser


class Clicks:
    """Keeps what was clicked in threads of the web server until the node's thread does it."""

    def __init__(self) -> None:
        self._waiting: deque[Callable[[], None]] = deque()

    def on(self, button: viser.GuiButtonHandle, act: Callable[[], None]) -> None:
        """Let a button do something."""
        button.on_click(lambda event: self._waiting.append(act))

    def take(self) -> Callable[[], None] | None:
        """Take what is to be done next, if there is something."""
        return self._waiting.popleft() if self._waiting else None


def move(slider: Any, value: float) -> None:
    """Move a slider to a value, or to its end before that."""
    slider.value = min(max(value, slider.min), slider.max)


def write(text: viser.GuiMarkdownHandle, content: str) -> None:
    """Write a text, if it is another one."""
    if text.content != content:
        text.content = content
