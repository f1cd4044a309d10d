"""A position that a gripper shall go to, or press on its way to it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kmn_perception.configuration.settings import NonNegative
from kmn_sim.control.trajectory_goal import Ending, Outcome


class GripperTolerances(NamedTuple):
    """When a gripper is where it should be, and when it stands, m or rad and seconds.

    Attributes
    ----------
    goal_tolerance
        Within which the position counts as reached.
    stall_velocity_threshold
        Up to which the gripper counts as standing.
    stall_timeout
        After which a gripper that stands elsewhere counts as stalled.
    """

    goal_tolerance: NonNegative
    stall_velocity_threshold: NonNegative
    stall_timeout: NonNegative


@dataclass(eq=False)
class GripperGoal:
    """Ends when the gripper is there, or stands for some time before it."""

    tolerances: GripperTolerances
    finish: Callable[[Outcome], None]
    _moved: float = 0.0  # seconds after the command at which it moved last

    def judge(
        self,
        names: Sequence[str],
        error: NDArray[np.float64],
        velocities: NDArray[np.float64],
        since_end: float,
    ) -> Outcome | None:
        """Return how the goal ends now, if it does; see `TrajectoryGoal.judge`."""
        tolerance, standing, timeout = self.tolerances
        if np.abs(error).max() < tolerance:
            return Outcome(Ending.SUCCESSFUL, "")
        if np.abs(velocities).max() > standing:
            self._moved = since_end
        if since_end - self._moved > timeout:
            return Outcome(Ending.STALLED, f"{names[0]} stands {abs(error[0]):.3f} before its goal")
        return None
