"""What a grasp depends on, how certain parameters of a door tell it, and how two doors differ."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.model.parts import PRISMATIC
from kmn_perception.model.transformation import wrap

# Of the quantities of a grasp.
HANDLE_POSITION, HINGE_POSITION, YAW = slice(0, 3), slice(3, 5), slice(5, 6)
FOUND_STD = 0.001  # metres, of where fingers find a handle
STEP = 1e-6  # of the parameters, for derivatives


def grasp_quantities(model: KinematicModel, values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return what a grasp depends on: position of the handle, of the hinge, yaw (6,) [m, rad]."""
    theta, gamma = model.split(values)
    hinge, lever = model.actions[0].joint, model.actions[0].grasp.body
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
    jacobian = _jacobian(model, values)
    spread = jacobian @ covariance @ jacobian.T
    handle, hinge, yaw = (
        math.sqrt(max(float(np.linalg.eigvalsh(spread[part, part])[-1]), 0.0))
        for part in (HANDLE_POSITION, HINGE_POSITION, YAW)
    )
    return handle, hinge, yaw


def _jacobian(model: KinematicModel, values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the derivatives (6, n + m) of the quantities by the parameters."""
    slopes = [
        (grasp_quantities(model, values + step) - grasp_quantities(model, values - step))
        / (2.0 * STEP)
        for step in STEP * np.eye(values.size)
    ]
    return np.array(slopes).T


def with_handle_moved(
    model: KinematicModel,
    values: NDArray[np.float64],
    covariance: NDArray[np.float64],
    offset: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return the likeliest parameters (n + m,) of a door whose handle is elsewhere by an offset.

    Parameters
    ----------
    covariance
        (n + m, n + m) of the values (n + m,); NaN where unknown: all are as uncertain.
    offset
        (3,) by which it was found elsewhere, metres.
    """
    slopes = _jacobian(model, values)[HANDLE_POSITION]
    if not np.isfinite(covariance).all():
        covariance = np.eye(values.size)
    spread = slopes @ covariance @ slopes.T + FOUND_STD**2 * np.eye(3)
    moved: NDArray[np.float64] = values + covariance @ slopes.T @ np.linalg.solve(spread, offset)
    return moved


def hinge_distance(
    model: KinematicModel, one: NDArray[np.float64], other: NDArray[np.float64]
) -> float:
    """Return how far apart (m) the hinges of two doors of parameters (n + m,) are."""
    places = [grasp_quantities(model, values)[HINGE_POSITION] for values in (one, other)]
    return float(np.linalg.norm(places[0] - places[1]))


def swung(model: KinematicModel, closed: NDArray[np.float64], seen: NDArray[np.float64]) -> float:
    """Return by how much (rad or m) a door of parameters (n + m,) moved until it is as it was seen.

    A joint whose motion no parameters tell, as about a horizontal axis, is taken to have stayed.
    """
    joint = model.actions[0].joint
    before, now = (grasp_quantities(model, values) for values in (closed, seen))
    axis = np.array(joint.axis) / np.linalg.norm(joint.axis)
    if joint.type == PRISMATIC:
        turn = model.transformation.matrix(model.split(closed)[0])[:3, :3]
        return float((now - before)[HANDLE_POSITION] @ turn @ axis)
    return float(axis[2] * wrap(now[YAW] - before[YAW])[0])
