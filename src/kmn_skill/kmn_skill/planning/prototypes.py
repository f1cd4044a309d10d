"""Solutions for the prototype, from which plans for other doors start.

Made by the executable ``make_prototypes`` and kept in ``config/skill/prototypes.json``.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kmn_perception.configuration import resources

PULL, PUSH = "pull", "push"


class Prototype(NamedTuple):
    """A first guess: its name, and the coarse path (T + 1, 13) with its start."""

    name: str
    path: NDArray[np.float64]


def guesses(door_angle: float, count: int, spread: float) -> Iterator[Prototype]:
    """Yield first guesses: the solution for the prototype, then variations of it.

    Parameters
    ----------
    door_angle
        To which the door shall be opened; its sign tells whether to pull or to push, radians.
    count
        Number of guesses.
    spread
        Standard deviation of base and arm from the solution, m and rad.
    """
    name = direction(door_angle)
    solution = load()[name]
    yield Prototype(name, solution)
    generator = np.random.default_rng(0)
    for number in range(1, count):
        varied = solution.copy()
        varied[1:, :10] += generator.normal(0.0, spread, 10)
        yield Prototype(f"{name}, varied {number}", varied)


@cache
def load() -> dict[str, NDArray[np.float64]]:
    """Return the solutions (T + 1, 13) for doors to pull and to push, each with its start."""
    file = resources.find("config/skill", "prototypes", ".json")
    solutions = json.loads(file.read_text(encoding="utf-8"))
    return {name: np.array(solutions[name], dtype=np.float64) for name in (PULL, PUSH)}


def direction(door_angle: float) -> str:
    """Return which way a door opens, of a robot before it, by the sign of its angle."""
    return PULL if door_angle < 0.0 else PUSH
