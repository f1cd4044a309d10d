"""What is planned, and the plan: a trajectory of robot and object with its phases."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kmn_skill.planning.surroundings import Obstacle


class PlanningFailed(Exception):  # noqa: N818
    """No plan was found that passes the check; the text says why."""


class PlanningCancelled(Exception):  # noqa: N818
    """The caller does not want the plan any more."""


@dataclass(frozen=True, eq=False)
class PlanRequest:
    """An object to be opened, from the present state of robot and object.

    Attributes
    ----------
    theta, gamma
        (n,) transformation and (m,) configuration parameters of the kinematic model.
    start
        (J,) present positions of the robot's joints, m and rad.
    object_start
        (2,) present positions of the object's joints, m and rad: of the one that is moved, and of
        the one that unlatches it.
    unlatched
        Position of the latter at which it does, m or rad; 0 where there is none.
    target
        Position to which the object is opened, m or rad: negative towards a robot before it (pull),
        positive away from it (push).
    obstacles
        What stands around the object.
    hold
        Number of the offset at which the hand takes hold, see `Grasp.offsets`.
    """

    theta: NDArray[np.float64]
    gamma: NDArray[np.float64]
    start: NDArray[np.float64]
    object_start: NDArray[np.float64]
    unlatched: float
    target: float
    obstacles: tuple[Obstacle, ...] = ()
    hold: int = 0

    @property
    def configuration(self) -> NDArray[np.float64]:
        """(D,) where robot and object are, m and rad."""
        return np.concatenate([self.start, self.object_start])

    def is_finite(self) -> bool:
        """Tell whether all numbers are finite."""
        values = (self.theta, self.gamma, self.start, self.object_start)
        targets = [self.unlatched, self.target]
        return all(np.isfinite(value).all() for value in (*values, targets))


class Phase(NamedTuple):
    """A part of the plan, from its first to its last configuration, both included."""

    name: str
    first: int
    last: int


@dataclass(frozen=True)
class PlanReport:
    """What the check of a plan found; metres, radians and seconds.

    Attributes
    ----------
    contact_error
        Largest distance between points of gripper and handle that should coincide.
    clearance
        Smallest distance between what must not touch.
    unlatched, opened
        Positions to which the joints are moved: that which unlatches, and at the end the other one.
    duration
        Of the motion.
    planning_time
        From the request to the plan.
    seed_used
        Name of the first guess that led to the plan.
    """

    contact_error: float
    clearance: float
    unlatched: float
    opened: float
    duration: float
    planning_time: float
    seed_used: str


@dataclass(frozen=True, eq=False)
class Plan:
    """A trajectory of T configurations.

    Attributes
    ----------
    joint_names
        Of the robot: base x, y, yaw, those of the arm, and the gripper's.
    times
        (T,) seconds from the start.
    positions, velocities
        (T, J) of the robot's joints, m and rad, and per second.
    object_joints
        (T, 2) positions of the object's joints, m and rad.
    phases
        One after the other; each begins where the one before ends.
    report
        What the check found.
    """

    joint_names: tuple[str, ...]
    times: NDArray[np.float64]
    positions: NDArray[np.float64]
    velocities: NDArray[np.float64]
    object_joints: NDArray[np.float64]
    phases: tuple[Phase, ...]
    report: PlanReport

    def phase(self, name: str) -> Phase:
        """Return the phase of a name."""
        return next(phase for phase in self.phases if phase.name == name)
