"""Transformation parameters theta and their affine transformation T_theta (paper, Eq. 1)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

AXES = ("x", "y", "z")
KINDS = ("translation", "rotation", "scale")


class Components(NamedTuple):
    """The geometric parts of theta; any number of leading axes."""

    translation: NDArray[np.float64]  # (..., 3) metres
    yaw: NDArray[np.float64]  # (...) radians about z
    scale: NDArray[np.float64]  # (..., 3) factors


@dataclass(frozen=True)
class Transformation:
    """The chain T_theta = translation * rotation about z * scale, in Aff(3).

    Each transformation parameter is one translation (metres), the rotation about z (radians),
    or one scale s that stretches by 1 + s; theta_0 = 0 is the identity.

    Attributes
    ----------
    kinds
        ``(kind, axis)`` of each parameter, in the order of theta.
    """

    kinds: tuple[tuple[str, str], ...]

    def __post_init__(self) -> None:
        if len(set(self.kinds)) != len(self.kinds):
            raise ValueError("each transformation may occur only once")
        for kind, axis in self.kinds:
            if kind not in KINDS or axis not in AXES:
                raise ValueError(f"unknown transformation '{kind} {axis}'")
        if ("rotation", "x") in self.kinds or ("rotation", "y") in self.kinds:
            raise ValueError("only rotations about z are supported")
        planar = {("translation", "x"), ("translation", "y")}
        if ("rotation", "z") in self.kinds and not planar <= set(self.kinds):
            raise ValueError("a rotation about z needs translations along x and y beside it")

    def components(self, theta: ArrayLike) -> Components:
        """Split theta (..., n) into translation, yaw and scale."""
        theta = np.asarray(theta, dtype=np.float64)
        translation = np.zeros((*theta.shape[:-1], 3))
        yaw = np.zeros(theta.shape[:-1])
        scale = np.ones((*theta.shape[:-1], 3))
        for i, (kind, axis) in enumerate(self.kinds):
            if kind == "translation":
                translation[..., AXES.index(axis)] = theta[..., i]
            elif kind == "rotation":
                yaw = theta[..., i]
            else:
                scale[..., AXES.index(axis)] = 1.0 + theta[..., i]
        return Components(translation, yaw, scale)

    def parameters(self, components: Components) -> NDArray[np.float64]:
        """Gather theta (..., n) from its components; the inverse of ``components``."""
        values: Sequence[NDArray[np.float64]] = [
            components.yaw
            if kind == "rotation"
            else components.translation[..., AXES.index(axis)]
            if kind == "translation"
            else components.scale[..., AXES.index(axis)] - 1.0
            for kind, axis in self.kinds
        ]
        return np.stack(values, axis=-1)

    def matrix(self, theta: ArrayLike) -> NDArray[np.float64]:
        """Return T_theta (..., 4, 4), which maps the prototype onto the model."""
        translation, yaw, scale = self.components(theta)
        matrix = np.zeros((*yaw.shape, 4, 4))
        matrix[..., :3, :3] = rotation_z(yaw) * scale[..., None, :]
        matrix[..., :3, 3] = translation
        matrix[..., 3, 3] = 1.0
        return matrix

    def inverse(self, theta: ArrayLike) -> NDArray[np.float64]:
        """Return T_theta^-1 (..., 4, 4), which maps the model onto the prototype."""
        return np.linalg.inv(self.matrix(theta)).astype(np.float64)

    def read_back(self, matrix: ArrayLike) -> NDArray[np.float64]:
        """Return theta of a transformation (..., 4, 4) of this family."""
        matrix = np.asarray(matrix, dtype=np.float64)
        yaw = np.arctan2(matrix[..., 1, 0], matrix[..., 0, 0])
        scale = np.linalg.norm(matrix[..., :3, :3], axis=-2)
        return self.parameters(Components(matrix[..., :3, 3], yaw, scale))

    def concatenate(self, first: ArrayLike, then: ArrayLike) -> NDArray[np.float64]:
        """Return theta of T_first * T_then, the paper's circle in Algorithm 1.

        Rotations concatenate with rotations and scales with scales. This is the matrix product
        wherever that belongs to the family; the shear that it else contains (a stretched box
        that is turned further) is left out, so that a box stays a box.
        """
        a, b = self.components(first), self.components(then)
        offset = rotation_z(a.yaw) @ (a.scale * b.translation)[..., None]
        return self.parameters(
            Components(a.translation + offset[..., 0], wrap(a.yaw + b.yaw), a.scale * b.scale)
        )

    def remainder(self, first: ArrayLike, total: ArrayLike) -> NDArray[np.float64]:
        """Return what is left to predict: ``concatenate(first, remainder) == total``."""
        a, c = self.components(first), self.components(total)
        offset = rotation_z(-a.yaw) @ (c.translation - a.translation)[..., None]
        return self.parameters(
            Components(offset[..., 0] / a.scale, wrap(c.yaw - a.yaw), c.scale / a.scale)
        )


def rotation_z(yaw: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the rotations (..., 3, 3) about z by ``yaw`` (...) radians."""
    cos, sin = np.cos(yaw), np.sin(yaw)
    zero, one = np.zeros_like(cos), np.ones_like(cos)
    rows = [[cos, -sin, zero], [sin, cos, zero], [zero, zero, one]]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def wrap(angle: NDArray[np.float64]) -> NDArray[np.float64]:
    """Wrap angles to [-pi, pi) radians."""
    return (angle + np.pi) % (2.0 * np.pi) - np.pi


def transform_points(
    matrix: NDArray[np.float64], points: NDArray[np.float32]
) -> NDArray[np.float32]:
    """Apply an affine transformation (4, 4) to points (..., 3)."""
    linear = matrix[:3, :3].T.astype(np.float32)
    return points @ linear + matrix[:3, 3].astype(np.float32)
