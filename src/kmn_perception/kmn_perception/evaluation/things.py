"""Things that are of no model, though they stand where objects do and are as large."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, Field

from kmn_perception.configuration import resources
from kmn_perception.configuration.settings import Count, Interval, load_settings
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.model.rotation import rotation_about


def _counts(interval: tuple[int, int]) -> tuple[int, int]:
    if not 1 <= interval[0] <= interval[1]:
        raise ValueError("they must rise from 1")
    return interval


Counts = Annotated[tuple[int, int], Field(min_length=2), AfterValidator(_counts)]


@dataclass(frozen=True)
class ThingSettings:
    """How things are drawn.

    Attributes
    ----------
    size
        Along each axis, of the prototype in whose place the thing is.
    board, boards
        Thickness of boards, of the thing's height; and how many a shelf has.
    leg
        Thickness of a table's legs, of its shorter side.
    parts, part
        Number of a stack's parts, and their sides, of those of the one below.
    sides
        Number of cuboids of which a column is made.
    moved
        By which a misplaced handle is farther than its limits have it, of the object's size.
    """

    size: Interval
    board: Interval
    boards: Counts
    leg: Interval
    parts: Counts
    part: Interval
    sides: Count
    moved: Interval

    @classmethod
    def load(cls) -> ThingSettings:
        """Read the settings; raise ``ConfigurationError`` with the key that is wrong."""
        return load_settings(cls, resources.share_directory() / "config/things.yaml")


class Draw(NamedTuple):
    """What a thing is drawn by: random numbers, and the size (3,) that it shall have, metres."""

    generator: np.random.Generator
    settings: ThingSettings
    size: NDArray[np.float64]

    def between(self, interval: tuple[float, float]) -> float:
        """Draw uniformly from an interval."""
        return float(self.generator.uniform(*interval))

    def count(self, interval: tuple[int, int]) -> int:
        """Draw a whole number; both ends are possible."""
        return int(self.generator.integers(*interval, endpoint=True))


def draw_thing(
    kind: str, model: KinematicModel, settings: ThingSettings, generator: np.random.Generator
) -> NDArray[np.float64]:
    """Draw a thing in the place of a model's object.

    Parameters
    ----------
    kind
        One of `kinds_of`.

    Returns
    -------
    cubes
        (B, 4, 4) maps of the unit cube to the world, metres.
    """
    values = model.sample(generator, 1)[0]
    theta, gamma = model.split(values)
    if kind in ALTERED:
        return ALTERED[kind](model, values, settings, generator)
    ends = [b.centre(gamma) + side * b.size(gamma) for b in model.bodies for side in (-0.5, 0.5)]
    low, high = np.min(ends, axis=0), np.max(ends, axis=0)
    shares = generator.uniform(*settings.size, size=3)
    cubes = SHAPES[kind](Draw(generator, settings, shares * (high - low)))
    ground = np.eye(4)
    ground[:3, 3] = *(0.5 * (low + high))[:2], low[2]
    return np.asarray(model.transformation.matrix(theta) @ ground @ np.array(cubes))


def kinds_of(model: KinematicModel) -> tuple[str, ...]:
    """Return the kinds of things that are no object of a model: a cuboid may be a carton."""
    if len(model.bodies) > 1:
        return (*SHAPES, *ALTERED)
    return tuple(kind for kind in SHAPES if kind != "cuboid")


def _cuboid(draw: Draw) -> list[NDArray[np.float64]]:
    return [_cube(draw.size, [0.0, 0.0, 0.5 * draw.size[2]])]


def _column(draw: Draw) -> list[NDArray[np.float64]]:
    """Draw a round column, but for its narrow sides."""
    count, diameter = draw.settings.sides, draw.size[:2].min()
    angles = np.pi / (2.0 * count) * np.arange(count)
    side = diameter / np.sqrt(2.0)
    middle = [0.0, 0.0, 0.5 * draw.size[2]]
    return [_cube([side, side, draw.size[2]], middle, angle) for angle in angles]


def _shelf(draw: Draw) -> list[NDArray[np.float64]]:
    """Draw an open shelf, its boards between two sides."""
    depth, width, height = draw.size
    thick = draw.between(draw.settings.board) * height
    sides = [
        _cube([depth, thick, height], [0.0, side * 0.5 * (width - thick), 0.5 * height])
        for side in (-1.0, 1.0)
    ]
    heights = np.linspace(0.5 * thick, height - 0.5 * thick, draw.count(draw.settings.boards))
    return sides + [_cube([depth, width, thick], [0.0, 0.0, z]) for z in heights]


def _stack(draw: Draw) -> list[NDArray[np.float64]]:
    """Draw cuboids that stand on one another, each turned at random."""
    count = draw.count(draw.settings.parts)
    base, angle, cubes = draw.size[:2], 0.0, list[NDArray[np.float64]]()
    for i in range(count):
        height = draw.size[2] / count
        cubes.append(_cube([*base, height], [0.0, 0.0, (i + 0.5) * height], angle))
        angle = draw.between((-0.5 * np.pi, 0.5 * np.pi))
        base = base * [draw.between(draw.settings.part) for _ in range(2)]
    return cubes


def _table(draw: Draw) -> list[NDArray[np.float64]]:
    depth, width, height = draw.size
    thick = draw.between(draw.settings.board) * height
    leg = draw.between(draw.settings.leg) * min(depth, width)
    legs = [
        _cube([leg, leg, height], [x * 0.5 * (depth - leg), y * 0.5 * (width - leg), 0.5 * height])
        for x in (-1.0, 1.0)
        for y in (-1.0, 1.0)
    ]
    return [*legs, _cube([depth, width, thick], [0.0, 0.0, height - 0.5 * thick])]


def _incomplete(
    model: KinematicModel,
    values: NDArray[np.float64],
    settings: ThingSettings,
    generator: np.random.Generator,
) -> NDArray[np.float64]:
    """Leave one body out, but not the first one, on which the others are."""
    cubes = model.unit_cubes(*model.split(values))
    return np.delete(cubes, generator.integers(1, len(cubes)), axis=0)


def _misplaced(
    model: KinematicModel,
    values: NDArray[np.float64],
    settings: ThingSettings,
    generator: np.random.Generator,
) -> NDArray[np.float64]:
    """Move the last body, as a handle, to the side or up, beyond where the limits have it."""
    theta, gamma = model.split(values)
    axis, side = int(generator.integers(1, 3)), float(generator.choice([-1.0, 1.0]))
    others = [b.centre.slope for b in model.bodies[:-1]] + [b.size.slope for b in model.bodies[:-1]]
    own = model.bodies[-1].centre.slope[axis] * ~np.any(others, axis=(0, 1))
    ends = side * own * model.limits[len(theta) :].T
    beyond = ends.max(axis=0).sum() - side * own @ gamma
    extent = max(body.size(gamma)[axis] for body in model.bodies)
    cubes = model.unit_cubes(np.zeros_like(theta), gamma)
    cubes[-1, axis, 3] += side * (beyond + generator.uniform(*settings.moved) * extent)
    return np.asarray(model.transformation.matrix(theta) @ cubes)


SHAPES: dict[str, Callable[[Draw], list[NDArray[np.float64]]]] = {
    "cuboid": _cuboid,
    "column": _column,
    "shelf": _shelf,
    "stack": _stack,
    "table": _table,
}
ALTERED = {"incomplete": _incomplete, "misplaced": _misplaced}


def _cube(
    size: NDArray[np.float64] | list[float], centre: list[float], yaw: float = 0.0
) -> NDArray[np.float64]:
    """Return the map (4, 4) of the unit cube to a cuboid that stands upright, metres."""
    cube = np.eye(4)
    cube[:3, :3] = rotation_about([0.0, 0.0, 1.0], yaw) @ np.diag(size)
    cube[:3, 3] = centre
    return cube
