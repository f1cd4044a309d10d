"""The bodies of a kinematic model as maps of unit cubes, and their derivatives by its parameters.

The parameters are the morphing parameters (theta, gamma), and after them the positions of those
joints that are free; all others are at 0.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.model.parts import REVOLUTE, Joint, movers
from kmn_perception.model.transformation import AXES, KINDS

TRANSLATION, ROTATION, SCALE = (KINDS.index(kind) for kind in ("translation", "rotation", "scale"))


class Shape(NamedTuple):
    """A kinematic model for compiled loops.

    It has B bodies, n transformation parameters, m of gamma and k free joints.
    """

    kinds: NDArray[np.int64]  # (n,) index into KINDS
    axes: NDArray[np.int64]  # (n,) index into AXES
    centre: NDArray[np.float64]  # (B, 3, 1 + m) constant, and slopes by gamma
    size: NDArray[np.float64]  # (B, 3, 1 + m) likewise
    turns: NDArray[np.bool_]  # (k,) whether a joint turns; else it slides
    joint_axes: NDArray[np.float64]  # (k, 3) of length 1
    origins: NDArray[np.float64]  # (k, 3, 1 + m) as the centres
    moved: NDArray[np.bool_]  # (B, k) which bodies a joint moves
    cylinders: NDArray[np.int64]  # (B,) axes as of KinematicModel.cylinder_axes


def shape_of(model: KinematicModel, free: Sequence[Joint] = ()) -> Shape:
    """Return the model's bodies, transformation chain and free joints as arrays.

    Parameters
    ----------
    free
        Joints in the order of the model, in which each stands after the one that moves its parent.
    """
    kinds = model.transformation.kinds
    names = [joint.name for joint in free]
    moved = [[name in movers(body.name, model.joints) for name in names] for body in model.bodies]
    axes = np.array([joint.axis for joint in free]).reshape(-1, 3)
    origins = [np.c_[joint.origin.constant, joint.origin.slope] for joint in free]
    return Shape(
        np.array([KINDS.index(kind) for kind, _ in kinds]),
        np.array([AXES.index(axis) for _, axis in kinds]),
        np.stack([np.c_[body.centre.constant, body.centre.slope] for body in model.bodies]),
        np.stack([np.c_[body.size.constant, body.size.slope] for body in model.bodies]),
        np.array([joint.type == REVOLUTE for joint in free], dtype=np.bool_),
        axes / np.linalg.norm(axes, axis=1, keepdims=True),
        np.array(origins).reshape(-1, 3, 1 + len(model.gamma)),
        np.array(moved, dtype=np.bool_).reshape(len(model.bodies), len(free)),
        model.cylinder_axes,
    )


@njit(cache=True, error_model="numpy")
def cuboids(
    shape: Shape, values: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the unit cubes' maps to the world (B, 3, 4), and their Jacobians (B, 3, 4, P)."""
    n, bodies, parameters = shape.kinds.shape[0], shape.centre.shape[0], values.shape[0]
    yaw, translation, scale = 0.0, np.zeros(3), np.ones(3)
    for i in range(n):
        if shape.kinds[i] == TRANSLATION:
            translation[shape.axes[i]] = values[i]
        elif shape.kinds[i] == ROTATION:
            yaw = values[i]
        else:
            scale[shape.axes[i]] = 1.0 + values[i]
    cos, sin = np.cos(yaw), np.sin(yaw)
    rotation = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    turned = np.array([[-sin, -cos, 0.0], [cos, -sin, 0.0], [0.0, 0.0, 0.0]])
    cubes = np.zeros((bodies, 3, 4))
    jacobians = np.zeros((bodies, 3, 4, parameters))
    for body in range(bodies):
        cube, jacobian = _in_object_frame(shape, values, body)
        for axis in range(3):
            for column in range(4):
                for k in range(3):
                    along = rotation[k, axis] * scale[axis]
                    cubes[body, k, column] += along * cube[axis, column]
                    for i in range(n, parameters):
                        jacobians[body, k, column, i] += along * jacobian[axis, column, i]
                    for i in range(n):
                        if shape.kinds[i] == ROTATION:
                            turn = turned[k, axis] * scale[axis]
                            jacobians[body, k, column, i] += turn * cube[axis, column]
                        elif shape.kinds[i] == SCALE and shape.axes[i] == axis:
                            jacobians[body, k, column, i] += rotation[k, axis] * cube[axis, column]
        cubes[body, :, 3] += translation
        for i in range(n):
            if shape.kinds[i] == TRANSLATION:
                jacobians[body, shape.axes[i], 3, i] += 1.0
    return cubes, jacobians


@njit(cache=True, error_model="numpy")
def _in_object_frame(
    shape: Shape, values: NDArray[np.float64], body: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return a unit cube's map to the object frame (3, 4), and its Jacobian (3, 4, P)."""
    n, m, joints = shape.kinds.shape[0], shape.centre.shape[2] - 1, shape.turns.shape[0]
    cube, jacobian = np.zeros((3, 4)), np.zeros((3, 4, values.shape[0]))
    for axis in range(3):
        for column in (axis, 3):  # the size fills the diagonal, the centre the last column
            row = shape.centre[body, axis] if column == 3 else shape.size[body, axis]
            cube[axis, column] = row[0]
            for j in range(m):
                cube[axis, column] += row[1 + j] * values[n + j]
                jacobian[axis, column, n + j] = row[1 + j]
    for joint in range(joints - 1, -1, -1):  # the last one hangs on those before it
        if not shape.moved[body, joint]:
            continue
        place, axis_of = n + m + joint, shape.joint_axes[joint]
        if shape.turns[joint]:
            _turn(shape, values, joint, place, cube, jacobian)
        else:
            cube[:, 3] += values[place] * axis_of
            jacobian[:, 3, place] += axis_of
    return cube, jacobian


@njit(cache=True, error_model="numpy")
def _turn(
    shape: Shape,
    values: NDArray[np.float64],
    joint: int,
    place: int,
    cube: NDArray[np.float64],
    jacobian: NDArray[np.float64],
) -> None:
    """Turn a cube's map (3, 4) and its Jacobian (3, 4, P) by a joint's angle, ``values[place]``."""
    n, m = shape.kinds.shape[0], shape.centre.shape[2] - 1
    x, y, z = shape.joint_axes[joint]
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    squared = np.outer(shape.joint_axes[joint], shape.joint_axes[joint]) - np.eye(3)  # cross^2
    angle = values[place]
    rotation = np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * squared
    turned = np.cos(angle) * cross + np.sin(angle) * squared
    origin = shape.origins[joint, :, 0].copy()
    for j in range(m):
        origin += shape.origins[joint, :, 1 + j] * values[n + j]
        jacobian[:, 3, n + j] -= shape.origins[joint, :, 1 + j]
    cube[:, 3] -= origin
    before, slopes = cube.copy(), jacobian.copy()
    for k in range(3):
        for column in range(4):
            cube[k, column] = 0.0
            jacobian[k, column] = 0.0
            for c in range(3):
                cube[k, column] += rotation[k, c] * before[c, column]
                jacobian[k, column] += rotation[k, c] * slopes[c, column]
                jacobian[k, column, place] += turned[k, c] * before[c, column]
    cube[:, 3] += origin
    for j in range(m):
        jacobian[:, 3, n + j] += shape.origins[joint, :, 1 + j]
