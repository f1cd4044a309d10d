"""Settings of the experiment, from ``config/skill/experiment.yaml``."""

from __future__ import annotations

from typing import NamedTuple

from kmn_perception.configuration import resources
from kmn_perception.configuration.section import Section
from kmn_skill.execution.opening import Goal

MODES = {"pull": -1.0, "push": 1.0}  # and the sign of the door's angle


class Pace(NamedTuple):
    """Simulated seconds in one second at most, and the camera's frames a simulated second."""

    real_time_factor: float
    camera_rate: float


class Timeouts(NamedTuple):
    """Seconds for the nodes to start, a door to be seen, and a door to be opened."""

    start: float
    scene: float
    goal: float


class Film(NamedTuple):
    """Pictures a simulated second, and pictures of a strip."""

    rate: float
    strip: int


class Experiment(NamedTuple):
    """What is done with each door.

    Attributes
    ----------
    handle_angle, door_angle
        Of the goal, radians; the door's without sign.
    opened
        Angle from which on a door counts as open, radians.
    evaluation, demo
        How fast each of them runs.
    timeouts, film
        How long to wait for what, and what is filmed.
    """

    handle_angle: float
    door_angle: float
    opened: float
    evaluation: Pace
    demo: Pace
    timeouts: Timeouts
    film: Film

    @classmethod
    def load(cls) -> Experiment:
        """Read ``config/skill/experiment.yaml``."""
        section = Section.load(resources.find("config/skill", "experiment"))
        section.allow(cls._fields)
        film = section.section("film")
        film.allow(Film._fields)
        return cls(
            handle_angle=section.number("handle_angle"),
            door_angle=section.number("door_angle", 0.0),
            opened=section.number("opened", 0.0),
            evaluation=Pace(*_numbers(section.section("evaluation"), Pace._fields)),
            demo=Pace(*_numbers(section.section("demo"), Pace._fields)),
            timeouts=Timeouts(*_numbers(section.section("timeouts"), Timeouts._fields)),
            film=Film(film.number("rate", 1.0), film.whole_number("strip", 1, 20)),
        )

    def goal(self, mode: str) -> Goal:
        """Return the goal of a mode, ``pull`` or ``push``."""
        return Goal(self.handle_angle, MODES[mode] * self.door_angle)

    def is_open(self, mode: str, hinge: float) -> bool:
        """Tell whether a door at this hinge angle (rad) is open to the right side."""
        return MODES[mode] * hinge >= self.opened


def _numbers(section: Section, names: tuple[str, ...]) -> list[float]:
    section.allow(names)
    return [section.number(name, 0.0) for name in names]
