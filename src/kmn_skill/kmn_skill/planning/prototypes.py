"""Solutions for some doors, from which plans for other doors start.

Made by ``make_prototypes`` and kept in ``config/skill/prototypes.json``.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import cycle
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kmn_perception.configuration import resources
from kmn_perception.configuration.section import ConfigurationError
from kmn_skill.planning.layout import BASE_AND_ARM, ROBOT
from kmn_skill.planning.plan import PlanRequest

PULL, PUSH = "pull", "push"
PUSH_IN_WALL = "push_in_wall"  # where the robot cannot stand beside the opening

SOLUTIONS = (PULL, PUSH, PUSH_IN_WALL)


class Solution(NamedTuple):
    """A solution: of which door, gamma (m,), and its coarse path (T + 1, D) with its start."""

    gamma: NDArray[np.float64]
    path: NDArray[np.float64]


class Guess(NamedTuple):
    """A first guess: its name, and the solution that it is."""

    name: str
    solution: Solution


@dataclass(frozen=True, eq=False)
class Prototypes:
    """Solutions for the prototype, and for some doors in a wall.

    Attributes
    ----------
    joints
        (D,) names of the columns: joints of the robot, then of the kinematic model.
    solutions
        For a door to pull, one to push, and some to push that stand in a wall; m and rad.
    """

    joints: tuple[str, ...]
    solutions: dict[str, list[Solution]]

    @classmethod
    def load(cls, name_or_path: str | Path = "prototypes") -> Prototypes:
        """Read ``config/skill/NAME.json`` or the user's own file."""
        file = resources.find("config/skill", name_or_path, ".json")
        stored = json.loads(file.read_text(encoding="utf-8"))
        solutions = {
            name: [Solution(*map(np.array, solution)) for solution in stored[name]]
            for name in SOLUTIONS
        }
        return cls(tuple(stored["joints"]), solutions)

    def save(self, file: Path) -> None:
        """Write the file that `load` reads."""
        stored = {
            name: [[gamma.tolist(), path.round(5).tolist()] for gamma, path in solutions]
            for name, solutions in self.solutions.items()
        }
        file.write_text(json.dumps({"joints": self.joints, **stored}) + "\n", encoding="utf-8")

    def check(self, joints: Sequence[str]) -> None:
        """Raise `ConfigurationError` if they are not for these joints of robot and object."""
        if self.joints != tuple(joints):
            raise ConfigurationError(
                f"the prototype's solutions are for the joints {', '.join(self.joints)}; those of "
                f"robot and model are {', '.join(joints)}: make them anew by make_prototypes"
            )

    def guesses(self, request: PlanRequest, count: int, spread: float) -> Iterator[Guess]:
        """Yield first guesses: the solutions of its kind, then variations of them.

        Parameters
        ----------
        request
            The solution for the most similar door comes first.
        count
            Number of guesses.
        spread
            Standard deviation of base and arm from the solution, m and rad.
        """
        name = direction(request.door_angle)
        if name == PUSH and request.obstacles:
            name = PUSH_IN_WALL
        nearest = sorted(
            self.solutions[name],
            key=lambda known: float(np.linalg.norm(known.gamma - request.gamma)),
        )
        for number, solution in enumerate(nearest[:count]):
            yield Guess(f"{name} {number}" if number else name, solution)
        generator = np.random.default_rng(0)
        for number, (gamma, path) in zip(range(len(nearest), count), cycle(nearest)):
            varied = path.copy()
            moving = varied[1:, ROBOT][:, BASE_AND_ARM]
            moving += generator.normal(0.0, spread, moving.shape[1])
            yield Guess(f"{name}, varied {number}", Solution(gamma, varied))


def direction(door_angle: float) -> str:
    """Return which way a door opens, of a robot before it, by the sign of its angle."""
    return PULL if door_angle < 0.0 else PUSH
