"""What a kinematic model consists of: parameters, bodies, joints; sizes and places in metres."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kmn_perception.model.rotation import matrix_from_quaternion

REVOLUTE, PRISMATIC, FIXED = JOINT_TYPES = ("revolute", "prismatic", "fixed")
WORLD = "world"  # parent of what stands still
CUBOID, CYLINDER = SHAPES = ("cuboid", "cylinder")
NO_AXIS = -1  # of a cuboid, among the axes of cylinders


@dataclass(frozen=True)
class Parameter:
    """A morphing parameter: its name, unit (m, rad or none) and limits; the prototype is at 0."""

    name: str
    unit: str
    limits: tuple[float, float]


@dataclass(frozen=True, eq=False)
class Linear:
    """A vector that is linear in gamma: ``constant + slope @ gamma``."""

    constant: NDArray[np.float64]  # (3,)
    slope: NDArray[np.float64]  # (3, m)

    def __call__(self, gamma: ArrayLike) -> NDArray[np.float64]:
        """Return the vector (3,) at gamma (m,)."""
        return self.constant + self.slope @ np.asarray(gamma, dtype=np.float64)


@dataclass(frozen=True)
class Body:
    """A cuboid in the object frame, or the cylinder that it holds: centre and size in metres.

    Attributes
    ----------
    axis
        Of the cylinder: 0, 1 or 2, along which it is as long as the cuboid; its diameter is the
        size along the other two. `NO_AXIS`: it is the cuboid itself.
    """

    name: str
    centre: Linear
    size: Linear
    axis: int = NO_AXIS

    @property
    def is_cylinder(self) -> bool:
        """Whether it is round."""
        return self.axis != NO_AXIS


@dataclass(frozen=True)
class Joint:
    """What lets a body move against its parent, in the object frame at the prototype's state.

    Attributes
    ----------
    type
        One of `JOINT_TYPES`.
    parent
        A body, or ``world``.
    axis
        (3,) about which a revolute, along which a prismatic joint moves; of any length but 0.
    origin
        Of a revolute joint, on its axis.
    limits
        Lowest and highest position, rad of a revolute and m of a prismatic joint.
    """

    name: str
    type: str
    body: str
    parent: str
    axis: tuple[float, ...]
    origin: Linear
    limits: tuple[float, float]

    @property
    def unit(self) -> str:
        """Of its position: ``m``, or ``rad``."""
        return "m" if self.type == PRISMATIC else "rad"

    @property
    def moves(self) -> bool:
        """Whether it is not fixed."""
        return self.type != FIXED

    def motion(self, gamma: ArrayLike, position: float) -> NDArray[np.float64]:
        """Return the motion (4, 4) in the object frame by which a position moves the body.

        Parameters
        ----------
        gamma
            (m,) configuration parameters, on which the joint's place depends.
        position
            Radians of a revolute, metres of a prismatic joint.
        """
        motion = np.eye(4)
        if self.type == FIXED:
            return motion
        axis = np.array(self.axis)
        axis = axis / np.linalg.norm(axis)
        if self.type == PRISMATIC:
            motion[:3, 3] = position * axis
            return motion
        half, origin = position / 2.0, self.origin(gamma)
        motion[:3, :3] = matrix_from_quaternion([*np.sin(half) * axis, np.cos(half)])
        motion[:3, 3] = origin - motion[:3, :3] @ origin
        return motion


def movers(body: str, joints: Sequence[Joint]) -> set[str]:
    """Return the names of the joints that move a body.

    Parameters
    ----------
    joints
        Each after the one that moves its parent.
    """
    found = set()
    for joint in reversed(joints):
        if joint.body == body:
            found.add(joint.name)
            body = joint.parent
    return found


@dataclass(frozen=True)
class Stem:
    """What joins a body to its parent at its joint: a square bar along x from face to face.

    The paper's model leaves it out, so that it is neither rendered nor fitted; it can be touched.

    Attributes
    ----------
    joint
        Of the body; the stem lies on its axis.
    body, parent
        The two that it joins.
    thickness
        Of the bar, metres.
    """

    joint: Joint
    body: Body
    parent: Body
    thickness: float

    def cuboid(self, gamma: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return centre and size (3,) at gamma (m,), metres in the object frame."""
        centre, half = self.body.centre(gamma), self.body.size(gamma) / 2.0
        start = centre[0] + half[0]
        end = self.parent.centre(gamma)[0] - self.parent.size(gamma)[0] / 2.0
        slack = half - self.thickness / 2.0
        pivot = np.clip(self.joint.origin(gamma), centre - slack, centre + slack)
        size = np.array([end - start, self.thickness, self.thickness])
        return np.array([(start + end) / 2.0, *pivot[1:]]), size


@dataclass(frozen=True)
class NetworkInput:
    """The depth image that the network sees.

    Attributes
    ----------
    width, height
        Size in pixels.
    near, far
        Depths in metres that become 1 and (almost) 0; 0 itself is the background.
    contrast
        Factor by which the network stretches depths about 1/2.
    supersampling
        The cloud is splatted on a grid this many times finer, then averaged.
    max_gap
        Holes of up to this many pixels of the finer grid are closed.
    """

    width: int
    height: int
    near: float
    far: float
    contrast: float
    supersampling: int
    max_gap: int
