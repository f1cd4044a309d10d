"""What a grasp depends on, and how certain parameters of a door tell it."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from kmn_perception.model.kinematic_model import KinematicModel
from kmn_skill.planning.layout import HANDLE, HINGE

# Of the quantities of a grasp.
HANDLE_POSITION, HINGE_POSITION, YAW = slice(0, 3), slice(3, 5), slice(5, 6)
STEP = 1e-6  # of the parameters, for derivatives


def grasp_quantities(model: KinematicModel, values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return what a grasp depends on: position of the handle, of the hinge, yaw (6,) [m, rad]."""
    theta, gamma = model.split(values)
    hinge, lever = model.joints[HINGE], model.body(model.joints[HANDLE].body)
    pose = model.transformation.matrix(theta)
    points = np.array([[*lever.centre(gamma), 1.0], [*hinge.origin(gamma), 1.0]]) @ pose.T
    yaw = model.transformation.components(theta).yaw
    return np.array([*points[0, :3], *points[1, :2], float(yaw)])


def grasp_deviations(
    model: KinematicModel, values: NDArray[np.float64], covariance: NDArray[np.float64]
) -> tuple[float, float, float]:
    """Return the largest standard deviations of handle (m), hinge (m) and yaw (rad).

    Parameters
    ----------
    covariance
        (n + m, n + m) of the values (n + m,).
    """
    steps = STEP * np.eye(values.size)
    slopes = [
        (grasp_quantities(model, values + step) - grasp_quantities(model, values - step))
        / (2.0 * STEP)
        for step in steps
    ]
    jacobian = np.array(slopes).T
    spread = jacobian @ covariance @ jacobian.T
    handle, hinge, yaw = (
        math.sqrt(max(float(np.linalg.eigvalsh(spread[part, part])[-1]), 0.0))
        for part in (HANDLE_POSITION, HINGE_POSITION, YAW)
    )
    return handle, hinge, yaw
