"""What can go wrong with a goal, apart from planning."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray

Reason = Literal[
    # interrupted
    "cancelled", "preempted", "node_ended",
    # the goal, or its plan
    "bad_goal", "no_plan",
    # the door
    "none", "few_frames", "stale", "future", "model", "status", "frame", "names", "not_finite",
    "out_of_limits", "handle_not_seen", "disagreement", "covariance", "uncertain",
    # states of robot and door, controllers
    "no_states", "states_stopped", "stale_states", "another_world", "controller",
    # the motion
    "tracking", "slipped", "missed_handle", "missed", "stuck",
    # a fault of the program
    "internal_error",
]  # fmt: skip


class SkillError(Exception):
    """A goal cannot be reached; the text says why.

    Attributes
    ----------
    reason
        Short key to count it by, e.g. ``slipped``.
    """

    def __init__(self, reason: Reason, text: str) -> None:
        super().__init__(text)
        self.reason: Reason = reason


class GoalError(SkillError):
    """The door cannot have the goal's angles."""


class DoorError(SkillError):
    """There is no door to rely on."""


class UncertainDoorError(DoorError):
    """A door is seen, but not known well enough to be grasped.

    Attributes
    ----------
    values
        (n + m,) parameters that it roughly has.
    """

    def __init__(self, reason: Reason, text: str, values: NDArray[np.float64]) -> None:
        super().__init__(reason, text)
        self.values = values


class StatesError(SkillError):
    """The states of robot or door cannot be relied upon."""


class ExecutionError(SkillError):
    """Robot or door do not follow the plan; another attempt may help."""


class BlockedHandError(ExecutionError):
    """The hand stood before it had closed about the handle.

    Attributes
    ----------
    width
        By which the fingers are apart, metres.
    stopped, crooked
        (3,) from where the handle was believed to where it must be, metres, world frame: if one
        finger stands at a handle that cannot be moved there, and if they hold it slantwise.
    """

    def __init__(
        self,
        text: str,
        width: float,
        stopped: NDArray[np.float64],
        crooked: NDArray[np.float64],
    ) -> None:
        super().__init__("missed_handle", text)
        self.width, self.stopped, self.crooked = width, stopped, crooked

    def offset(self, before: BlockedHandError | None) -> NDArray[np.float64]:
        """Return the likelier offset (3,); that it is stopped was tried if it stood so before."""
        tried = before is not None and self.width >= before.width
        return self.crooked if tried else self.stopped


class ControllerError(SkillError):
    """A controller of the robot does not do what it was sent."""


class InterruptedGoal(SkillError):  # noqa: N818
    """The goal was cancelled, or who pursues it ends."""
