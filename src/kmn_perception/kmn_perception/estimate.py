"""What is known of one object: morphing parameters, their covariance, and what they are worth."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kmn_perception.model.kinematic_model import KinematicModel


class Status(IntEnum):
    """What an estimate is worth; equal to the constants of kmn_msgs/MorphingParameters."""

    OK = 0
    NO_OBJECT = 1
    TOO_FEW_POINTS = 2
    NOT_CONVERGED = 3
    OUT_OF_LIMITS = 4
    HANDLE_NOT_SEEN = 5
    AMBIGUOUS = 6


def status_name(status: int) -> str:
    """Return the name of a status; the number where it has none."""
    return next((each.name for each in Status if each == status), str(status))


class Quantity(NamedTuple):
    """The state of a joint, or a parameter of the surroundings, with its standard deviation."""

    name: str
    value: float
    deviation: float


@dataclass(frozen=True, eq=False)
class Estimate:
    """Morphing parameters of one observation; NaN where there is no estimate.

    Attributes
    ----------
    model, theta, gamma
        The model, and its (n,) and (m,) morphing parameters, metres, radians and scales.
    covariance
        (n + m, n + m) over (theta, gamma); NaN without refinement.
    transform
        (4, 4) T_theta, from the prototype to the world.
    iterations, converged
        Number of predictions, and whether the last one was near the identity or the refinement
        found the model in the observation.
    residual
        Median distance of the points to the predicted surface, metres.
    points_used
        Number of points.
    status, reason
        What it is worth; the reason is empty when the status is OK.
    alternative, mirrored
        Kind of the handle, where the model has several and one was seen; and whether the object is
        the model mirrored in y, which then belongs to ``transform``.
    joints, surroundings
        What else was estimated, in units of the model.
    sensor_error
        What the frame tells about an error of the sensor, for people to read.
    """

    model: KinematicModel
    theta: NDArray[np.float64]
    gamma: NDArray[np.float64]
    covariance: NDArray[np.float64]
    transform: NDArray[np.float64]
    iterations: int
    converged: bool
    residual: float
    points_used: int
    status: Status
    reason: str
    alternative: str = ""
    mirrored: bool = False
    joints: tuple[Quantity, ...] = ()
    surroundings: tuple[Quantity, ...] = ()
    sensor_error: str = ""

    @property
    def positions(self) -> dict[str, float]:
        """Positions of the joints that were estimated, by their names."""
        return {joint.name: joint.value for joint in self.joints}

    @classmethod
    def none(cls, model: KinematicModel, points: int, status: Status, reason: str) -> Estimate:
        """Return the estimate that says why there is none."""
        n, m = len(model.theta), len(model.gamma)
        return cls(
            model=model,
            theta=np.full(n, np.nan),
            gamma=np.full(m, np.nan),
            covariance=np.full((n + m, n + m), np.nan),
            transform=np.full((4, 4), np.nan),
            iterations=0,
            converged=False,
            residual=np.nan,
            points_used=points,
            status=status,
            reason=reason,
        )
