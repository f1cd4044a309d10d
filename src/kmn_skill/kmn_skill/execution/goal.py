"""A goal to open a door, how it ended, and those with whom it has to do."""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from kmn_skill.execution.errors import InterruptedGoal
from kmn_skill.execution.plan_execution import Part
from kmn_skill.planning.plan import Plan, PlanReport

SUCCESS = "success"  # outcome of a goal that was reached


class Goal(NamedTuple):
    """Angles (rad) to which to press the handle and to open the door."""

    handle_angle: float
    door_angle: float


class Result(NamedTuple):
    """How a goal ended.

    Attributes
    ----------
    outcome
        `SUCCESS`, or a short key of what went wrong.
    reason
        Why not, for people to read; empty on success.
    handle_angle, door_angle
        Largest handle angle reached, and the door angle in the end, radians.
    report
        What the check of the last plan found, if there was one.
    attempts
        Plans that were begun.
    tracking_error
        Largest one, in units of the tolerances.
    """

    outcome: str
    reason: str
    handle_angle: float = np.nan
    door_angle: float = np.nan
    report: PlanReport | None = None
    attempts: int = 0
    tracking_error: float = np.nan


class Feedback(NamedTuple):
    """What is being done: phase, part of it all that is done (0 to 1), and the door's angles."""

    phase: str
    progress: float
    handle_angle: float
    door_angle: float


class Commands(Protocol):
    """What moves the robot."""

    def now(self) -> float:
        """Return the present time on the clock of the robot's states, seconds."""

    def show(self, plan: Plan, values: NDArray[np.float64]) -> None:
        """Show a plan for a door of some morphing parameters (n + m,)."""

    def send(self, part: Part) -> None:
        """Send a part of the plan."""

    def hold(self) -> None:
        """Let the robot hold where it is."""

    def tell(self, text: str) -> None:
        """Tell people what happened."""


class Client(Protocol):
    """Who wants the door to be opened."""

    def interruption(self) -> InterruptedGoal | None:
        """Return why the goal is not wanted any more, if it is not."""

    def feed_back(self, feedback: Feedback) -> None:
        """Take what is being done."""
