"""The kinematic model's cuboids, and how they move with the morphing parameters."""

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
    centre: NDArray[np.float64]  # (B, 3, 1 + m) constant and slopes
    size: NDArray[np.float64]  # (B, 3, 1 + m)


def shape_of(model: KinematicModel) -> Shape:
    """Return the model's cuboids and transformation chain as arrays."""
    kinds = model.transformation.kinds
    return Shape(
        np.array([KINDS.index(kind) for kind, _ in kinds]),
        np.array([AXES.index(axis) for _, axis in kinds]),
        np.stack([np.c_[body.centre.constant, body.centre.slope] for body in model.bodies]),
        np.stack([np.c_[body.size.constant, body.size.slope] for body in model.bodies]),
    )


def unit_cubes_jacobian(model: KinematicModel, values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the derivative (B, 4, 4, n + m) of ``KinematicModel.unit_cubes`` at some values."""
    _, slopes = cuboids(shape_of(model), values)
    return np.concatenate([slopes, np.zeros_like(slopes[:, :1])], axis=1)


@njit(cache=True, error_model="numpy")
def cuboids(
    shape: Shape, values: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the unit cubes' maps to the world (B, 3, 4) and their slopes (B, 3, 4, P)."""
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
    slopes = np.zeros((bodies, 3, 4, values.shape[0]))
    for b in range(bodies):
        for axis in range(3):
            for column in (axis, 3):  # the size fills the diagonal, the centre the last column
                row = shape.centre[b, axis] if column == 3 else shape.size[b, axis]
                length = row[0]
                for j in range(row.shape[0] - 1):
                    length += row[1 + j] * values[n + j]
                for k in range(3):
                    along = rotation[k, axis] * scale[axis]
                    cubes[b, k, column] += along * length
                    for j in range(row.shape[0] - 1):
                        slopes[b, k, column, n + j] += along * row[1 + j]
                    for i in range(n):
                        if shape.kinds[i] == ROTATION:
                            slopes[b, k, column, i] += turned[k, axis] * scale[axis] * length
                        elif shape.kinds[i] == SCALE and shape.axes[i] == axis:
                            slopes[b, k, column, i] += rotation[k, axis] * length
        cubes[b, :, 3] += translation
        for i in range(n):
            if shape.kinds[i] == TRANSLATION:
                slopes[b, shape.axes[i], 3, i] += 1.0
    return cubes, slopes
