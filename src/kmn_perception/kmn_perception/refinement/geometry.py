"""The cuboids of a kinematic model, and their derivatives by the morphing parameters."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.model.transformation import AXES, KINDS

TRANSLATION, ROTATION, SCALE = (KINDS.index(kind) for kind in ("translation", "rotation", "scale"))


class Shape(NamedTuple):
    """A kinematic model for compiled loops: B bodies, n transformation parameters, m of gamma."""

    kinds: NDArray[np.int64]  # (n,) index into KINDS
    axes: NDArray[np.int64]  # (n,) index into AXES
    centre: NDArray[np.float64]  # (B, 3, 1 + m) constant, and slopes by gamma
    size: NDArray[np.float64]  # (B, 3, 1 + m) likewise


def shape_of(model: KinematicModel) -> Shape:
    """Return the model's cuboids and transformation chain as arrays."""
    kinds = model.transformation.kinds
    return Shape(
        np.array([KINDS.index(kind) for kind, _ in kinds]),
        np.array([AXES.index(axis) for _, axis in kinds]),
        np.stack([np.c_[body.centre.constant, body.centre.slope] for body in model.bodies]),
        np.stack([np.c_[body.size.constant, body.size.slope] for body in model.bodies]),
    )


@njit(cache=True, error_model="numpy")
def cuboids(
    shape: Shape, values: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the unit cubes' maps to the world (B, 3, 4), and their Jacobians (B, 3, 4, P)."""
    n, bodies = shape.kinds.shape[0], shape.centre.shape[0]
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
    jacobians = np.zeros((bodies, 3, 4, values.shape[0]))
    for body in range(bodies):
        for axis in range(3):
            for column in (axis, 3):  # the size fills the diagonal, the centre the last column
                row = shape.centre[body, axis] if column == 3 else shape.size[body, axis]
                length = row[0]
                for j in range(row.shape[0] - 1):
                    length += row[1 + j] * values[n + j]
                for k in range(3):
                    along = rotation[k, axis] * scale[axis]
                    cubes[body, k, column] += along * length
                    for j in range(row.shape[0] - 1):
                        jacobians[body, k, column, n + j] += along * row[1 + j]
                    for i in range(n):
                        if shape.kinds[i] == ROTATION:
                            jacobians[body, k, column, i] += turned[k, axis] * scale[axis] * length
                        elif shape.kinds[i] == SCALE and shape.axes[i] == axis:
                            jacobians[body, k, column, i] += rotation[k, axis] * length
        cubes[body, :, 3] += translation
        for i in range(n):
            if shape.kinds[i] == TRANSLATION:
                jacobians[body, shape.axes[i], 3, i] += 1.0
    return cubes, jacobians
