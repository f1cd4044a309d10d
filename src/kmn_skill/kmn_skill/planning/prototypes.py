"""Solutions for some objects, from which plans for others start.

Made by ``make_prototypes`` and kept in ``config/skill/prototypes``: of each robot a folder with a
file for each kind of motion.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import cycle, product
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kmn_perception.configuration import resources
from kmn_perception.configuration.output import replacing
from kmn_perception.configuration.section import ConfigurationError, Section
from kmn_skill.planning.layout import BASE_AND_ARM, ROBOT
from kmn_skill.planning.plan import PlanRequest
from kmn_skill.planning.robot import default_robot
from kmn_skill.planning.surroundings import WALL

PULL, PUSH = "pull", "push"
PUSH_IN_WALL = "push_in_wall"  # where the robot cannot stand beside the opening

SOLUTIONS = (PULL, PUSH, PUSH_IN_WALL)


class Solution(NamedTuple):
    """A solution: of which object, gamma (m,), and its coarse path (T + 1, D) with its start."""

    gamma: NDArray[np.float64]
    path: NDArray[np.float64]


class Guess(NamedTuple):
    """A first guess: its name, the solution that it is, and where the hand takes hold.

    The latter is the number of an offset, see `Grasp.offsets`.
    """

    name: str
    solution: Solution
    hold: int = 0


@dataclass(frozen=True, eq=False)
class Prototypes:
    """Solutions for the prototype, and for some that stand in a wall.

    Attributes
    ----------
    joints
        (D,) names of the columns: joints of the robot, then of the kinematic model.
    solutions
        By `SOLUTIONS`: to pull, to push, and to push what stands in a wall; m and rad. Some
        objects can be pulled only.
    """

    joints: tuple[str, ...]
    solutions: dict[str, list[Solution]]

    @classmethod
    def load(cls, motions: str, robot: str | Path = "") -> Prototypes:
        """Read those of a kind of motion.

        Parameters
        ----------
        motions
            As an object's action names them: a file, or a name.
        robot
            As `RobotModel.load` takes it, skill_node's where none is told. Motions of a name are in
            ``config/skill/prototypes/ROBOT/NAME.json``, or in a folder beside the user's own file
            of the robot, whose name the folder has without the ending.

        Raises
        ------
        FileNotFoundError
            If they have not been made.
        ConfigurationError
            If the file does not hold any.
        """
        name = Path(robot or default_robot())
        file: str | Path = name.with_suffix("") / f"{motions}.json"
        if Path(motions).suffix:
            file = motions
        elif not name.suffix:
            file = f"{name}/{motions}"
        try:
            found = resources.find("config/skill/prototypes", file, ".json")
        except FileNotFoundError as error:
            raise FileNotFoundError(f"{error}: make_prototypes makes a robot's motions") from error
        stored = Section.load_json(found)
        stored.allow(("joints",), SOLUTIONS)
        joints = stored.values["joints"]
        if not isinstance(joints, list) or not all(isinstance(name, str) for name in joints):
            raise stored.error(f"'joints' must be names, found {joints!r}")
        solutions = {
            name: _read(stored, name, len(joints)) if name in stored else [] for name in SOLUTIONS
        }
        return cls(tuple(joints), solutions)

    def save(self, file: Path) -> None:
        """Write the file that `load` reads."""
        stored = {
            name: [[gamma.tolist(), path.round(5).tolist()] for gamma, path in solutions]
            for name, solutions in self.solutions.items()
        }
        text = json.dumps({"joints": self.joints, **stored})
        with replacing(file) as new:
            new.write_text(text + "\n", encoding="utf-8")

    def check(self, joints: Sequence[str]) -> None:
        """Raise `ConfigurationError` if they are not for these joints of robot and object."""
        if self.joints != tuple(joints):
            raise ConfigurationError(
                f"the prototype's solutions are for the joints {', '.join(self.joints)}; those of "
                f"robot and model are {', '.join(joints)}: make them anew by make_prototypes"
            )

    def guesses(
        self, request: PlanRequest, count: int, spread: float, holds: int = 1
    ) -> Iterator[Guess]:
        """Yield first guesses: the solutions of its kind for each hold, then variations of them.

        Parameters
        ----------
        request
            The solution for the most similar door comes first.
        count
            Number of guesses for each hold.
        spread
            Standard deviation of base and arm from the solution, m and rad.
        holds
            Number of offsets at which the hand may take hold.
        """
        name = direction(request.target)
        if name == PUSH and any(each.name.startswith(WALL) for each in request.obstacles):
            name = PUSH_IN_WALL
        if not self.solutions[name]:
            return
        nearest = sorted(
            self.solutions[name],
            key=lambda known: float(np.linalg.norm(known.gamma - request.gamma)),
        )
        known = list(product(range(holds), nearest[:count]))
        for number, (hold, solution) in enumerate(known):
            yield Guess(f"{name} {number}" if number else name, solution, hold)
        generator = np.random.default_rng(0)
        for number, (hold, (gamma, path)) in zip(range(len(known), count * holds), cycle(known)):
            varied = path.copy()
            moving = varied[1:, ROBOT][:, BASE_AND_ARM]
            moving += generator.normal(0.0, spread, moving.shape[1])
            yield Guess(f"{name}, varied {number}", Solution(gamma, varied), hold)


def _read(stored: Section, name: str, columns: int) -> list[Solution]:
    """Return the solutions of a name, whose paths have so many columns."""
    found = []
    try:
        for gamma, path in stored.values[name]:
            solution = Solution(np.array(gamma, np.float64), np.array(path, np.float64))
            if solution.gamma.ndim != 1 or solution.path.shape[1:] != (columns,):
                raise ValueError("their shapes are wrong")
            if not all(np.isfinite(part).all() for part in solution):
                raise ValueError("not all numbers are finite")
            found.append(solution)
    except (TypeError, ValueError) as error:
        raise stored.error(
            f"'{name}' must be pairs of gamma and a path of {columns} columns: {error}"
        ) from error
    return found


def direction(target: float) -> str:
    """Return which way an object opens, of a robot before it, by the sign of its target."""
    return PULL if target < 0.0 else PUSH
