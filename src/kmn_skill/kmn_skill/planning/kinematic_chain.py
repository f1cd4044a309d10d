"""Where the parts of a robot are at positions of its joints; without the package robotic."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kmn_perception.model.rotation import matrix_from_quaternion


class Link(NamedTuple):
    """What a joint carries.

    Attributes
    ----------
    parent
        Name of the link that carries the joint; empty for the world.
    offset
        (4, 4) pose in the parent at position 0.
    axis
        (3,) about or along which the joint moves, in the link's own frame; of length 1, or the
        part of the named joint's motion that this one makes.
    slides
        Whether it moves along the axis (m) instead of about it (rad).
    joint
        Whose position moves it: its own, or that of the joint which it follows.
    """

    parent: str
    offset: NDArray[np.float64]
    axis: NDArray[np.float64]
    slides: bool
    joint: str


@dataclass(frozen=True, eq=False)
class KinematicChain:
    """The links of a robot by name, each after its parent.

    Attributes
    ----------
    joint_names
        (J,) names in the order of the positions.
    """

    joint_names: tuple[str, ...]
    links: Mapping[str, Link]

    def poses(self, positions: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
        """Return the poses (4, 4) of all links in the world at positions (J,), m and rad."""
        places = dict(zip(self.joint_names, positions.tolist(), strict=True))
        poses = {"": np.eye(4)}
        for name, link in self.links.items():
            poses[name] = poses[link.parent] @ link.offset @ _motion(link, places[link.joint])
        del poses[""]
        return poses


def _motion(link: Link, position: float) -> NDArray[np.float64]:
    """Return the motion (4, 4) in the link's frame by which a position moves it."""
    motion = np.eye(4)
    if link.slides:
        motion[:3, 3] = position * link.axis
        return motion
    part = float(np.linalg.norm(link.axis))
    half = 0.5 * part * position
    motion[:3, :3] = matrix_from_quaternion([*np.sin(half) * link.axis / part, np.cos(half)])
    return motion
