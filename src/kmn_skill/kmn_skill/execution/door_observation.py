"""A door as a message tells it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kmn_perception.model.kinematic_model import KinematicModel
from kmn_skill.execution.errors import DoorError


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
    joints
        Positions of joints by their names, m or rad: the values are of the closed door then. Where
        that of its hinge is not among them, they are of the door as it stands.
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
    joints: Mapping[str, float] = MappingProxyType({})


def check_values(
    model: KinematicModel, observation: DoorObservation, frame: str, limit_margin: float
) -> None:
    """Raise a `DoorError` if the values are not such of a model in a frame.

    Parameters
    ----------
    limit_margin
        Part of its range by which a parameter may exceed its limits.
    """
    if observation.frame != frame:
        raise DoorError("frame", f"the door is given in '{observation.frame}', expected '{frame}'")
    names = tuple(parameter.name for parameter in model.parameters)
    count = len(names)
    shapes = observation.values.shape, observation.covariance.shape
    if observation.names != names or shapes != ((count,), (count, count)):
        raise DoorError(
            "names",
            f"found the {observation.values.size} parameters {', '.join(observation.names)} "
            f"with {observation.covariance.size} covariances, expected {', '.join(names)}",
        )
    if not np.isfinite(observation.values).all():
        raise DoorError("not_finite", f"parameters are not finite: {observation.values.tolist()}")
    for parameter, value in zip(model.parameters, observation.values, strict=True):
        low, high = parameter.limits
        margin = limit_margin * (high - low)
        if not low - margin <= value <= high + margin:
            raise DoorError(
                "out_of_limits", f"{parameter.name} = {value:.3f} is outside [{low:g}, {high:g}]"
            )


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
