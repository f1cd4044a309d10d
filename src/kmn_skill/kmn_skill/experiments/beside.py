"""Objects beside the one that is opened: what nodes are told of them, and whether they move."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from sensor_msgs.msg import JointState

from kmn_msgs.msg import MorphingParameters
from kmn_perception.configuration.settings import Interval, NonNegative

FIRST_ID = 1  # that sim_node gives the object where others stand beside it


class Row(NamedTuple):
    """Objects with others beside them.

    Attributes
    ----------
    limits
        Of what is drawn, metres and radians; else those of the model.
    closed
        By which a joint of what is beside may move and still count as closed, m or rad.
    """

    limits: dict[str, Interval]
    closed: NonNegative


class Beside:
    """The objects beside the one of a system.

    Parameters
    ----------
    options
        Of a program: ``beside``, their models, separated by commas; without it there are none.
    closed
        By which a joint of theirs may move and still count as closed, m or rad.
    """

    def __init__(self, options: argparse.Namespace, closed: float) -> None:
        self._names = model_names(vars(options).get("beside", ""))
        self._closed = closed
        self._furthest: dict[str, float] = {}

    @property
    def count(self) -> int:
        """How many there are."""
        return len(self._names)

    def of_sim_node(self) -> dict[str, Any]:
        """Return the parameters by which sim_node has them."""
        return {"beside": ",".join(self._names)} if self._names else {}  # none can be empty

    def of_morph_node(self, model: str) -> dict[str, Any]:
        """Return the parameters by which morph_node tells them, beside an object of a model."""
        if not self._names:
            return {}
        return {"model": ",".join(dict.fromkeys([model, *self._names])), "objects": "all"}

    def meant(
        self, seen: Sequence[MorphingParameters], truth: MorphingParameters
    ) -> MorphingParameters:
        """Return, of what was seen, the newest of the object that truly is there.

        If there was none that can be used, one that cannot; NaN if it was not seen at all.
        """
        alike = [each for each in seen if each.model == truth.model]
        if not alike:
            unknown = {name: [np.nan] * len(getattr(truth, name)) for name in ("theta", "gamma")}
            return MorphingParameters(model=truth.model, **unknown)
        usable = [each for each in alike if each.status == each.OK] or alike[-1:]
        newest = [each for each in usable if each.header.stamp == usable[-1].header.stamp]
        if len(newest) == 1:
            return newest[0]
        return min(newest, key=lambda m: float(np.linalg.norm(np.subtract(truth.theta, m.theta))))

    def watch(self) -> None:
        """Note from now on how far their joints move."""
        self._furthest = {}

    def on_state(self, message: JointState) -> None:
        """Note where their joints are."""
        for name, position in zip(message.name, message.position, strict=True):
            self._furthest[name] = max(abs(position), self._furthest.get(name, 0.0))

    def moved(self) -> str:
        """Return which of their joints were moved, for people; empty if none was."""
        return "; ".join(
            f"{name} beside it was moved by {position:.3f} [m, rad]"
            for name, position in self._furthest.items()
            if position > self._closed
        )


def model_names(text: str) -> list[str]:
    """Return the names of models that are separated by commas."""
    return [name for name in map(str.strip, text.split(",")) if name]


def add_beside_option(parser: argparse.ArgumentParser) -> None:
    """Let a program be told what stands beside the object."""
    parser.add_argument(
        "--beside",
        default="",
        metavar="MODEL[,MODEL]",
        help="objects that stand in one row with it and must stay closed; default none",
    )
