"""Lever or knob: which of them explains better what is seen around a handle."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from kmn_perception.doors.handle_shape import KINDS, explain
from kmn_perception.doors.part_settings import HandleSettings
from kmn_perception.doors.wall_view import WallView


class SeenKind(NamedTuple):
    """The kind of a handle, and its middle.

    Attributes
    ----------
    kind
        The likelier one.
    odds
        How much likelier it is than the other.
    s, z
        See `Handle`, metres.
    along, up
        Standard deviations of these, which hold for the other kind, too, metres.
    """

    kind: str
    odds: float
    s: float
    z: float
    along: float
    up: float


def kind_of(
    view: WallView,
    side: str,
    at: tuple[float, float],
    lever_odds: float,
    settings: HandleSettings,
) -> SeenKind:
    """Return what is seen at a place of a panel.

    What each kind leaves unexplained and the network speak for one of them; where neither is sure,
    the middle may be that of the other kind.

    Parameters
    ----------
    side
        At which the latch is, ``left`` or ``right`` as seen.
    at
        About where its middle is seen: metres along the panel and above the floor.
    lever_odds
        How much likelier than a knob a lever is to the network; 1 without one.
    """
    shape = settings.shape
    lever, knob = (explain(view, kind, side, at, shape) for kind in KINDS)
    # Of Gaussian errors with an unknown deviation, as many as are independent of each other.
    evidence = shape.weight * np.log(knob.misfit / lever.misfit)
    most = np.log(settings.max_odds)
    evidence += float(np.clip(np.log(lever_odds), -most, most))
    kinds = KINDS if evidence > 0.0 else KINDS[::-1]
    seen, other = (lever, knob) if evidence > 0.0 else (knob, lever)
    odds = float(np.exp(abs(evidence)))
    spread = np.sqrt(odds) / (1.0 + odds)  # of two places, by how likely each of them is
    along = np.hypot(settings.along_noise, spread * (other.s - seen.s))
    up = np.hypot(settings.up_noise, spread * (other.z - seen.z))
    return SeenKind(kinds[0], odds, seen.s, seen.z, float(along), float(up))
