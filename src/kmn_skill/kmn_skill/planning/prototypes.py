"""Solutions for the prototype, from which plans for other doors start.

Made by ``make_prototypes`` and kept in ``config/skill/prototypes.json``.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kmn_perception.configuration import resources
from kmn_perception.configuration.section import ConfigurationError
from kmn_skill.planning.layout import BASE_AND_ARM, ROBOT

PULL, PUSH = "pull", "push"


class Guess(NamedTuple):
    """A first guess: its name, and the coarse path (T + 1, D) with its start."""

    name: str
    path: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Prototypes:
    """Solutions for the prototype.

    Attributes
    ----------
    joints
        (D,) names of the columns: joints of the robot, then of the kinematic model.
    paths
        (T + 1, D) positions for a door to pull and one to push, each with its start, m and rad.
    """

    joints: tuple[str, ...]
    paths: dict[str, NDArray[np.float64]]

    @classmethod
    def load(cls, name_or_path: str | Path = "prototypes") -> Prototypes:
        """Read ``config/skill/NAME.json`` or the user's own file."""
        file = resources.find("config/skill", name_or_path, ".json")
        stored = json.loads(file.read_text(encoding="utf-8"))
        paths = {name: np.array(stored[name], dtype=np.float64) for name in (PULL, PUSH)}
        return cls(tuple(stored["joints"]), paths)

    def save(self, file: Path) -> None:
        """Write the file that `load` reads."""
        paths = {name: path.round(5).tolist() for name, path in self.paths.items()}
        file.write_text(json.dumps({"joints": self.joints, **paths}) + "\n", encoding="utf-8")

    def check(self, joints: Sequence[str]) -> None:
        """Raise `ConfigurationError` if they are not for these joints of robot and object."""
        if self.joints != tuple(joints):
            raise ConfigurationError(
                f"the prototype's solutions are for the joints {', '.join(self.joints)}; those of "
                f"robot and model are {', '.join(joints)}: make them anew by make_prototypes"
            )

    def guesses(self, door_angle: float, count: int, spread: float) -> Iterator[Guess]:
        """Yield first guesses: the solution for the prototype, then variations of it.

        Parameters
        ----------
        door_angle
            To which the door is to be opened; its sign tells whether to pull or to push, radians.
        count
            Number of guesses.
        spread
            Standard deviation of base and arm from the solution, m and rad.
        """
        name = direction(door_angle)
        solution = self.paths[name]
        yield Guess(name, solution)
        generator = np.random.default_rng(0)
        for number in range(1, count):
            varied = solution.copy()
            moving = varied[1:, ROBOT][:, BASE_AND_ARM]
            moving += generator.normal(0.0, spread, moving.shape[1])
            yield Guess(f"{name}, varied {number}", varied)


def direction(door_angle: float) -> str:
    """Return which way a door opens, of a robot before it, by the sign of its angle."""
    return PULL if door_angle < 0.0 else PUSH
