"""How the bodies of a kinematic model move with its joints."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.model.parts import Joint
from kmn_perception.model.rotation import matrix_from_quaternion


def turn(joint: Joint, gamma: NDArray[np.float64], angle: float) -> NDArray[np.float64]:
    """Return the motion (4, 4) in the object frame by which a joint moves its body.

    Parameters
    ----------
    gamma
        (m,) configuration parameters, on which the joint's place depends.
    angle
        Of the joint, radians.
    """
    axis, origin = np.array(joint.axis), joint.origin(gamma)
    axis = axis / np.linalg.norm(axis)
    motion = np.eye(4)
    motion[:3, :3] = matrix_from_quaternion([*np.sin(angle / 2.0) * axis, np.cos(angle / 2.0)])
    motion[:3, 3] = origin - motion[:3, :3] @ origin
    return motion


def moved_cubes(
    model: KinematicModel, values: NDArray[np.float64], angles: Sequence[float]
) -> NDArray[np.float64]:
    """Return the bodies as maps (B, 4, 4) of the unit cube to the world, at some joint angles.

    Parameters
    ----------
    values
        (n + m,) morphing parameters.
    angles
        Of the model's joints, each of which may move the next one's parent; radians.
    """
    theta, gamma = model.split(values)
    motions = {"world": np.eye(4)}
    for joint, angle in zip(model.joints, angles, strict=True):
        motions[joint.body] = motions[joint.parent] @ turn(joint, gamma, angle)
    pose = model.transformation.matrix(theta)
    closed = np.linalg.inv(pose) @ model.unit_cubes(theta, gamma)
    moved = [
        motions.get(body.name, np.eye(4)) @ cube
        for body, cube in zip(model.bodies, closed, strict=True)
    ]
    return pose @ np.array(moved)
