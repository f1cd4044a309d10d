"""What can go wrong with a goal, apart from planning."""

from __future__ import annotations


class SkillError(Exception):
    """A goal cannot be reached; the text says why.

    Attributes
    ----------
    reason
        Short key to count it by, e.g. ``slipped``.
    """

    def __init__(self, reason: str, text: str) -> None:
        super().__init__(text)
        self.reason = reason


class GoalError(SkillError):
    """The door cannot have the goal's angles."""


class DoorError(SkillError):
    """There is no door to rely on."""


class StatesError(SkillError):
    """The states of robot or door cannot be relied upon."""


class ExecutionError(SkillError):
    """Robot or door do not follow the plan; another attempt may help."""


class InterruptedGoal(SkillError):  # noqa: N818
    """The goal was cancelled, or who pursues it ends."""
