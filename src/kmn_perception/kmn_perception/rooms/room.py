"""A room: cuboids with their materials, lights, the camera, and the truth about its door."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kmn_perception.model.camera import Camera


class Material(NamedTuple):
    """How a body looks: a solid texture of low contrast, and joints as of bricks or panels.

    Attributes
    ----------
    albedo
        Fraction of the light that it returns.
    contrast
        Deviation of the texture, as a fraction of the albedo.
    grain
        Size of the texture along x, y and z of the wall's frame, metres.
    shift
        Of the texture along all axes, metres: bodies of one material with the same shift are one.
    tile
        Length and height of what the joints part, metres; 0: no joints.
    stagger
        Of every second row, as a fraction of the length.
    joint
        Width of the joints, metres.
    joint_albedo
        Factor of the albedo in the joints.
    """

    albedo: float
    contrast: float = 0.0
    grain: tuple[float, float, float] = (0.1, 0.1, 0.1)
    shift: float = 0.0
    tile: tuple[float, float] = (0.0, 0.0)
    stagger: float = 0.0
    joint: float = 0.0
    joint_albedo: float = 1.0


class Light(NamedTuple):
    """A lamp at a point (3,) of the wall's frame, metres, and the light that it gives at 1 m."""

    position: tuple[float, float, float]
    power: float


class Lighting(NamedTuple):
    """The lights of a room.

    Attributes
    ----------
    lights
        Lamps, of which the first casts shadows.
    ambient
        Light from all around, which does not depend on the place.
    softness
        Half width of the edges of shadows, pixels of the shadow map; 0: no shadows.
    """

    lights: tuple[Light, ...]
    ambient: float
    softness: float


class Cuboid(NamedTuple):
    """A cuboid: its name, the map (4, 4) of the unit cube to the world, and its material."""

    name: str
    cube: NDArray[np.float64]
    material: Material


@dataclass(frozen=True, eq=False)
class Door:
    """The truth about a door.

    Attributes
    ----------
    values
        (7,) theta and gamma of the model of the rooms; theta is the closed panel's.
    nuisance
        By name, the nuisances of the model: recess, frame, opening.
    handle, side, fitting
        Kind of the handle, where it is as seen, and what is behind it.
    frame
        (4, 4) pose of the panel as it stands in the world: front towards -x, y to the left as seen,
        z up from the floor.
    corners
        By name (``top_left`` as seen), (3,) corners of the panel's front, optical frame, metres.
    opening
        The same of the front of what is around the closed panel: of its frame, or of the wall.
    handle_centre
        (3,) middle of the handle, optical frame, metres; None without one.
    """

    values: NDArray[np.float64]
    nuisance: dict[str, float]
    handle: str
    side: str
    fitting: str
    frame: NDArray[np.float64]
    corners: dict[str, NDArray[np.float64]]
    opening: dict[str, NDArray[np.float64]]
    handle_centre: NDArray[np.float64] | None


@dataclass(frozen=True, eq=False)
class Room:
    """What is rendered.

    Attributes
    ----------
    kind
        ``door``, or the name of what stands there instead (`negatives`).
    cuboids
        All bodies; of two that coincide the first one is seen.
    wall
        (4, 4) pose of the wall's frame in the world: x into the wall, z up from the floor.
    camera
        With its pose in the world, where z = 0 is the floor.
    door
        The truth; None if there is no single solid door.
    glass
        Names of bodies that the grey image shows, and where no depth is measured.
    """

    kind: str
    cuboids: tuple[Cuboid, ...]
    wall: NDArray[np.float64]
    lighting: Lighting
    camera: Camera
    door: Door | None
    glass: tuple[str, ...] = ()


def cuboid(
    name: str,
    low: ArrayLike,
    high: ArrayLike,
    material: Material,
    frame: NDArray[np.float64],
    turn: float = 0.0,
) -> Cuboid:
    """Return the cuboid between two corners (3,) in a frame (4, 4).

    Parameters
    ----------
    turn
        Angle by which it is turned about the vertical through its middle, rad.
    """
    low, high = np.asarray(low, dtype=np.float64), np.asarray(high, dtype=np.float64)
    c, s = np.cos(turn), np.sin(turn)
    cube = np.eye(4)
    cube[:2, :2] = [[c, -s], [s, c]]
    cube[:3, :3] *= high - low
    cube[:3, 3] = (low + high) / 2.0
    return Cuboid(name, frame @ cube, material)
