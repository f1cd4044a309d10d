"""A trajectory that somebody waits for: how closely it must be followed, and how it ended."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray


class Ending(Enum):
    """How a goal ended."""

    SUCCESSFUL = "successful"
    PREEMPTED = "preempted"
    CANCELLED = "cancelled"
    PATH_TOLERANCE_VIOLATED = "path tolerance violated"
    GOAL_TOLERANCE_VIOLATED = "goal tolerance violated"
    STALLED = "stalled"


class Outcome(NamedTuple):
    """How a goal ended, and why, for people to read."""

    ending: Ending
    text: str


class Tolerances(NamedTuple):
    """By how much J joints may miss a trajectory, m and rad; 0: by anything.

    Attributes
    ----------
    path, goal
        (J,) while they move, and at the end.
    goal_time
        Seconds after the end at which they must be there at the latest; 0: some time.
    """

    path: NDArray[np.float64]
    goal: NDArray[np.float64]
    goal_time: float


class Goal(Protocol):
    """What somebody waits for."""

    @property
    def finish(self) -> Callable[[Outcome], None]:
        """Is told how it ended."""

    def judge(
        self,
        names: Sequence[str],
        error: NDArray[np.float64],
        velocities: NDArray[np.float64],
        since_end: float,
    ) -> Outcome | None:
        """Return how the goal ends now, if it does; see `TrajectoryGoal.judge`."""


@dataclass(frozen=True, eq=False)
class TrajectoryGoal:
    """What must be kept, and who is told how it ended."""

    tolerances: Tolerances
    finish: Callable[[Outcome], None]

    def judge(
        self,
        names: Sequence[str],
        error: NDArray[np.float64],
        velocities: NDArray[np.float64],
        since_end: float,
    ) -> Outcome | None:
        """Return how the goal ends now, if it does.

        Parameters
        ----------
        names, error
            (J,) the joints, and by how much each of them misses its desired position, m and rad.
        velocities
            (J,) of the joints, per second.
        since_end
            Seconds since the trajectory's end; below 0 before it.
        """
        path, goal, goal_time = self.tolerances
        if since_end < 0.0:
            missed = _worst(names, error, path)
            return Outcome(Ending.PATH_TOLERANCE_VIOLATED, missed) if missed else None
        missed = _worst(names, error, goal)
        if not missed:
            return Outcome(Ending.SUCCESSFUL, "")
        if 0.0 < goal_time < since_end:
            return Outcome(
                Ending.GOAL_TOLERANCE_VIOLATED, f"{since_end:.2f} s after the end {missed}"
            )
        return None


def _worst(names: Sequence[str], error: NDArray[np.float64], allowed: NDArray[np.float64]) -> str:
    """Tell of the joint that exceeds its tolerance most; empty if none does."""
    excess = np.where(allowed > 0.0, np.abs(error) - allowed, -np.inf)
    worst = int(excess.argmax())
    if excess[worst] <= 0.0:
        return ""
    return (
        f"{names[worst]} is off by {abs(error[worst]):.3f}, "
        f"expected at most {allowed[worst]:g} [m, rad]"
    )
