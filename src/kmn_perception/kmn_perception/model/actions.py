"""What can be done with an object: which body is grasped, and which joint is moved how far."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kmn_perception.configuration.section import Section
from kmn_perception.model.parts import Body, Joint, movers
from kmn_perception.model.transformation import AXES


@dataclass(frozen=True)
class Grasp:
    """Where a hand takes a body, in the object frame.

    Attributes
    ----------
    offsets
        From the body's centre, metres: where it is taken, and then where else it can be.
    axis
        ``x``, ``y`` or ``z``, along which its two points lie on the body's surface.
    """

    body: Body
    offsets: tuple[tuple[float, ...], ...]
    axis: str

    def place(self, gamma: ArrayLike, number: int = 0) -> NDArray[np.float64]:
        """Return the middle (3,) between its two points at gamma (m,), at an offset, metres."""
        return self.body.centre(gamma) + self.offsets[number]

    def thickness(self, gamma: ArrayLike) -> float:
        """Return how far apart its two points are at gamma (m,), metres."""
        return float(self.body.size(gamma)[AXES.index(self.axis)])


@dataclass(frozen=True)
class Action:
    """Moves a joint of the object by a hand that holds one of its bodies.

    Attributes
    ----------
    joint
        That is moved.
    target
        Its position in the end unless another one is asked for, m or rad.
    unlatch
        Joint that is moved first, to let go what holds the other one, if there is such a thing.
    unlatched
        Position of that joint at which it is let go, m or rad.
    motions
        Name of the motions that are transferred to this object, or the path of their file.
    force_limit
        Largest force with which what is grasped is moved on, newtons; infinite if not told.
    """

    name: str
    joint: Joint
    target: float
    unlatch: Joint | None
    unlatched: float
    grasp: Grasp
    motions: str
    force_limit: float = math.inf

    @property
    def joints(self) -> tuple[Joint, ...]:
        """The joints that it moves: the one that is meant, then the one that unlatches it."""
        return (self.joint,) if self.unlatch is None else (self.joint, self.unlatch)

    def positions(self, values: ArrayLike) -> dict[str, float]:
        """Return positions (2,) of what is moved and what unlatches it by the joints' names."""
        places = np.asarray(values, dtype=np.float64).tolist()
        return {joint.name: place for joint, place in zip(self.joints, places, strict=False)}


def read_actions(
    section: Section, bodies: Sequence[Body], joints: Sequence[Joint], folder: Path
) -> tuple[Action, ...]:
    """Read the actions, whose grasped bodies their joints must move.

    Parameters
    ----------
    folder
        Of the model's file, to which a file of motions is relative.
    """
    actions = section.section("actions")
    by_name = {joint.name: joint for joint in joints if joint.moves}
    if actions.values and not by_name:
        raise actions.error("an action needs a joint that moves, and there is none")
    found = []
    for name in actions.values:
        action = actions.section(name)
        action.allow(("joint", "target", "grasp"), ("unlatch", "motions", "force_limit"))
        joint = by_name[action.text("joint", by_name)]
        unlatch, unlatched = None, 0.0
        if "unlatch" in action:
            first = action.section("unlatch")
            first.allow(("joint", "target"))
            unlatch = by_name[first.text("joint", by_name)]
            unlatched = first.number("target", *unlatch.limits)
        grasp = _read_grasp(action.section("grasp"), bodies)
        read = Action(
            name,
            joint,
            action.number("target", *joint.limits),
            unlatch,
            unlatched,
            grasp,
            _motions(action.text("motions", default=section.text("name")), folder),
            action.number("force_limit", 1.0) if "force_limit" in action else math.inf,
        )
        moved = movers(grasp.body.name, joints)
        if missing := [each.name for each in read.joints if each.name not in moved]:
            raise action.error(
                f"grasp: '{grasp.body.name}' is not moved by the joint '{missing[0]}'"
            )
        found.append(read)
    return tuple(found)


def _motions(name: str, folder: Path) -> str:
    """Return the path of a file of motions, or a name as it is."""
    return str((folder / name).absolute()) if Path(name).suffix else name


def _read_grasp(section: Section, bodies: Sequence[Body]) -> Grasp:
    section.allow(("body", "axis"), ("offset", "others"))
    by_name = {body.name: body for body in bodies}
    offset = section.numbers("offset", 3) if "offset" in section else [0.0] * 3
    others = section.table("others", 3) if "others" in section else []
    body = by_name[section.text("body", by_name)]
    return Grasp(body, tuple(map(tuple, [offset, *others])), section.text("axis", AXES))
