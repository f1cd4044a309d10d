"""Solutions for the prototype, from which plans for other doors start.

Made by ``python -m kmn_skill.make_prototypes`` and kept in ``config/skill/prototypes.json``.
"""

from __future__ import annotations

import json
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kmn_perception import resources

PULL, PUSH = "pull", "push"


class Prototype(NamedTuple):
    """A solution: its name, and the coarse path (T, 13)."""

    name: str
    path: NDArray[np.float64]


@cache
def load() -> dict[str, tuple[Prototype, ...]]:
    """Return the solutions for doors to pull and to push, the best ones first."""
    file = resources.find("config/skill", "prototypes", ".json")
    solutions = json.loads(file.read_text(encoding="utf-8"))
    return {
        direction: tuple(
            Prototype(f"{direction} {number}", np.array(path))
            for number, path in enumerate(solutions[direction], 1)
        )
        for direction in (PULL, PUSH)
    }


def direction(door_angle: float) -> str:
    """Return which way a door opens, of a robot before it, by the sign of its angle."""
    return PULL if door_angle < 0.0 else PUSH
