"""Conversions between ROS messages and what the simulation has."""

from __future__ import annotations

from array import array
from collections.abc import Callable, Iterable, Sequence

import cv2
import numpy as np
from numpy.typing import NDArray
from sensor_msgs.msg import Image, JointState
from std_msgs.msg import Header
from trajectory_msgs.msg import JointTrajectory

from kmn_msgs.msg import MorphingParameters
from kmn_perception.ros.stamps import seconds
from kmn_sim.control.trajectory import Command, Waypoint
from kmn_sim.world.scenario import Scenario

ENCODINGS = ("rgb8", "mono8")  # of images


def command_from_message(
    message: JointTrajectory, to_simulated: Callable[[float], float]
) -> Command:
    """Read a trajectory; a stamp of 0 means at once.

    Parameters
    ----------
    to_simulated
        Converts the time of stamps into simulated time, both in seconds.
    """
    stamp = seconds(message.header.stamp)
    return Command(
        names=tuple(message.joint_names),
        points=[
            Waypoint(
                seconds(point.time_from_start),
                *map(tuple, (point.positions, point.velocities, point.accelerations, point.effort)),
            )
            for point in message.points
        ],
        start=to_simulated(stamp) if stamp != 0.0 else None,
    )


def joint_state(
    names: Sequence[str],
    positions: Iterable[float],
    velocities: Iterable[float],
    efforts: Iterable[float],
    header: Header,
) -> JointState:
    """Make the message of some joints' state."""
    return JointState(
        header=header,
        name=list(names),
        position=[float(value) for value in positions],
        velocity=[float(value) for value in velocities],
        effort=[float(value) for value in efforts],
    )


def ground_truth(
    scenario: Scenario, values: NDArray[np.float64], header: Header
) -> MorphingParameters:
    """Make the message of the true morphing parameters (n + m,); the door's, when closed."""
    model = scenario.model
    theta, gamma = model.split(values)
    return MorphingParameters(
        header=header,
        model=model.name,
        theta_names=[parameter.name for parameter in model.theta],
        theta=theta.tolist(),
        gamma_names=[parameter.name for parameter in model.gamma],
        gamma=gamma.tolist(),
        covariance=[0.0] * values.size**2,
        transform=model.transformation.matrix(theta).ravel(),
        converged=True,
        residual=0.0,
        status=MorphingParameters.OK,
    )


def image_from_colour(colour: NDArray[np.uint8], encoding: str, header: Header) -> Image:
    """Make an image of colours (height, width, 3), RGB; ``rgb8`` or ``mono8``."""
    pixels = cv2.cvtColor(colour, cv2.COLOR_RGB2GRAY) if encoding == "mono8" else colour
    height, width = colour.shape[:2]
    message = Image(header=header, height=height, width=width, encoding=encoding)
    message.step = pixels.nbytes // height
    message.data = array("B", pixels.tobytes())
    return message
