"""Tells people the phases of a goal as they come."""

from __future__ import annotations

from kmn_msgs.action import OpenDoor


class Narrator:
    """Prints what is being done, when it changes."""

    def __init__(self) -> None:
        self._told = ""

    def tell(self, feedback: OpenDoor.Feedback) -> None:
        """Print the phase, if it is another one."""
        if feedback.phase != self._told:
            self._told = feedback.phase
            print(
                f"  {feedback.phase:7s} {100 * feedback.progress:3.0f} %   "
                f"handle {feedback.handle_angle:5.2f} rad   door {feedback.door_angle:5.2f} rad",
                flush=True,
            )
