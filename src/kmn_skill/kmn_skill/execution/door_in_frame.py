"""A door that is given in one frame, as it stands in another one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from kmn_perception.configuration import resources
from kmn_perception.configuration.settings import NonNegative, load_settings
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.model.transformation import wrap
from kmn_skill.execution.door_observation import DoorObservation
from kmn_skill.execution.errors import DoorError

STEP = 1e-6  # of theta, for derivatives


@dataclass(frozen=True)
class FrameSettings:
    """By how much the grounds of two frames may differ, radians and metres."""

    max_tilt: NonNegative
    max_height: NonNegative

    @classmethod
    def load(cls) -> FrameSettings:
        """Read ``config/skill/frames.yaml``."""
        return load_settings(cls, resources.find("config/skill", "frames"))


def door_in_frame(
    model: KinematicModel,
    observation: DoorObservation,
    frame: str,
    pose: NDArray[np.float64],
    settings: FrameSettings,
) -> DoorObservation:
    """Return an observation in another frame, its covariance turned with it.

    What has other parameters than the model is returned as it is, for others to refuse.

    Parameters
    ----------
    pose
        (4, 4) of the observation's frame in the other one.

    Raises
    ------
    DoorError
        If the grounds of the two differ.
    """
    count, moved = len(model.theta), observation._replace(frame=frame)
    if observation.values.shape != (len(model.parameters),):
        return moved
    theta, gamma = model.split(observation.values)

    def turned(theta: NDArray[np.float64]) -> NDArray[np.float64]:
        return model.transformation.read_back(pose @ model.transformation.matrix(theta))

    tilt = float(np.arccos(np.clip(pose[2, 2], -1.0, 1.0)))
    height = float((pose @ model.transformation.matrix(theta))[2, 3])
    if tilt > settings.max_tilt or abs(height) > settings.max_height:
        raise DoorError(
            "frame",
            f"the ground of '{observation.frame}' is tilted by {np.degrees(tilt):.1f} deg and "
            f"{height:+.3f} m high at the door in '{frame}', expected at most "
            f"{np.degrees(settings.max_tilt):.1f} deg and {settings.max_height:g} m",
        )
    jacobian = np.eye(len(observation.values))
    for column, step in enumerate(STEP * np.eye(count)):
        difference = turned(theta + step) - turned(theta - step)
        jacobian[:count, column] = wrap(difference) / (2.0 * STEP)
    covariance = observation.covariance
    if covariance.shape == jacobian.shape:
        covariance = jacobian @ covariance @ jacobian.T
    return moved._replace(values=np.concatenate([turned(theta), gamma]), covariance=covariance)
