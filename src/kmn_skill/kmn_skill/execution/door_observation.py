"""A door as a message tells it."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kmn_perception.model.kinematic_model import KinematicModel


class DoorObservation(NamedTuple):
    """Morphing parameters as they came.

    Attributes
    ----------
    time
        Of the exposure, seconds.
    model, frame
        Names of the kinematic model and of the frame that the door is given in.
    names
        Names of theta and gamma.
    values
        (n + m,) theta and gamma [m, rad, 1].
    covariance
        (n + m, n + m) of the values; NaN where unknown.
    problem
        Why they are not valid; empty if they are.
    lacks_handle
        Whether they are valid but for the handle, which was not seen or is no lever.
    recess
        Of the panel's front behind the wall's face, metres; NaN where unknown.
    number
        Of the object, the same in all frames.
    hinge
        Angle of the hinge, radians: the values are of the closed door then. NaN where unknown: they
        are of the door as it stands.
    """

    time: float
    model: str
    frame: str
    names: tuple[str, ...]
    values: NDArray[np.float64]
    covariance: NDArray[np.float64]
    problem: str
    lacks_handle: bool = False
    number: int = 0
    recess: float = math.nan
    hinge: float = math.nan


def when_closed(
    model: KinematicModel, values: NDArray[np.float64], hinge_angle: float
) -> NDArray[np.float64]:
    """Return the parameters (n + m,) of the same door when closed.

    Parameters
    ----------
    values
        (n + m,) parameters as seen; perception takes every door for a closed one.
    hinge_angle
        By which it was open, radians or metres.
    """
    theta, gamma = model.split(values)
    joint = model.actions[0].joint
    shut = model.transformation.matrix(theta) @ joint.motion(gamma, -hinge_angle)
    closed = model.transformation.read_back(shut)
    return np.concatenate([closed, gamma])
