"""What is planned, and the plan: a trajectory of robot and door with its phases."""

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
    """A door to be opened, from the present state of robot and door.

    Attributes
    ----------
    theta, gamma
        (n,) transformation and (m,) configuration parameters of the kinematic model.
    start
        (J,) present positions of the robot's joints, m and rad.
    door_start
        (2,) present angles of hinge and handle, radians.
    handle_angle
        Angle to which the handle is pressed, radians; negative as in the model.
    door_angle
        Angle to which the door is opened, radians: negative towards a robot before the door
        (pull), positive away from it (push).
    obstacles
        What stands around the door.
    """

    theta: NDArray[np.float64]
    gamma: NDArray[np.float64]
    start: NDArray[np.float64]
    door_start: NDArray[np.float64]
    handle_angle: float
    door_angle: float
    obstacles: tuple[Obstacle, ...] = ()

    @property
    def configuration(self) -> NDArray[np.float64]:
        """(D,) where robot and door are, m and rad."""
        return np.concatenate([self.start, self.door_start])

    def is_finite(self) -> bool:
        """Tell whether all numbers are finite."""
        values = (self.theta, self.gamma, self.start, self.door_start)
        angles = [self.handle_angle, self.door_angle]
        return all(np.isfinite(value).all() for value in (*values, angles))


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
    handle_angle, door_angle
        To which the handle is pressed, and the door is opened at the end.
    duration
        Of the motion.
    planning_time
        From the request to the plan.
    seed_used
        Name of the first guess that led to the plan.
    """

    contact_error: float
    clearance: float
    handle_angle: float
    door_angle: float
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
    door
        (T, 2) angles of hinge and handle, radians.
    phases
        One after the other; each begins where the one before ends.
    report
        What the check found.
    """

    joint_names: tuple[str, ...]
    times: NDArray[np.float64]
    positions: NDArray[np.float64]
    velocities: NDArray[np.float64]
    door: NDArray[np.float64]
    phases: tuple[Phase, ...]
    report: PlanReport

    def phase(self, name: str) -> Phase:
        """Return the phase of a name."""
        return next(phase for phase in self.phases if phase.name == name)
