"""A goal to open an object, how it ended, and those with whom it has to do."""

from __future__ import annotations

from typing import Final, Literal, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from kmn_skill.execution.errors import InterruptedGoal, Reason
from kmn_skill.execution.plan_execution import Part
from kmn_skill.planning.plan import Plan, PlanReport

SUCCESS: Final = "success"  # outcome of a goal that was reached
Outcome = Reason | Literal["success"]


class Goal(NamedTuple):
    """What is to be done.

    Attributes
    ----------
    unlatched, target
        Positions (m or rad) to which to move what unlatches the object, and then the object.
    object_id
        Number of the object, as its parameters have it; 0: whichever is seen.
    action
        Number of the action in the object's file, from 0.
    """

    unlatched: float
    target: float
    object_id: int = 0
    action: int = 0


class Result(NamedTuple):
    """How a goal ended.

    Attributes
    ----------
    outcome
        `SUCCESS`, or a short key of what went wrong.
    reason
        Why not, for people to read; empty on success.
    unlatched, opened
        Furthest position of what unlatches the object, and where the object is in the end, m or
        rad.
    report
        What the check of the last plan found, if there was one.
    attempts
        Plans that were begun.
    tracking_error
        Largest one, in units of the tolerances.
    """

    outcome: Outcome
    reason: str
    unlatched: float = np.nan
    opened: float = np.nan
    report: PlanReport | None = None
    attempts: int = 0
    tracking_error: float = np.nan


class Feedback(NamedTuple):
    """What is being done.

    Attributes
    ----------
    phase, progress
        Its name, and the part of it all that is done, 0 to 1.
    unlatched, opened
        Present positions of what unlatches the object, and of the object, m or rad.
    """

    phase: str
    progress: float
    unlatched: float
    opened: float


class Commands(Protocol):
    """What moves the robot."""

    def now(self) -> float:
        """Return the present time on the clock of the robot's states, seconds."""

    def show(self, plan: Plan, values: NDArray[np.float64]) -> None:
        """Show a plan for a door of some morphing parameters (n + m,)."""

    def send(self, part: Part) -> None:
        """Send a part of the plan."""

    def are_through(self) -> bool:
        """Tell whether all controllers are through with what was sent, as far as they tell.

        Raises
        ------
        ControllerError
            If one of them failed.
        """

    def hold(self, positions: NDArray[np.float64]) -> None:
        """Let the robot hold at positions (J,) of its joints, where it is, m and rad."""

    def tell(self, text: str) -> None:
        """Tell people what happened."""


class Client(Protocol):
    """Who wants the door to be opened."""

    def interruption(self) -> InterruptedGoal | None:
        """Return why the goal is not wanted any more, if it is not."""

    def feed_back(self, feedback: Feedback) -> None:
        """Take what is being done."""
