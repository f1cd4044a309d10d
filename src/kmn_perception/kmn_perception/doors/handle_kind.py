"""Lever or knob: what a handle spans on its panel tells its kind, and where its middle is."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from kmn_perception.doors.part_settings import HandleSettings


class Span(NamedTuple):
    """What a handle spans on its panel.

    What stands out is seen shifted against its foot, and the neck between them joins the two. A
    lever points inward: it hides its neck where the shift is outward, and prolongs it elsewhere.

    Attributes
    ----------
    first, last
        Along the panel, metres.
    shift
        Of a handle's middle against the point of the panel behind it, metres to the right.
    outward
        Whether that is towards the panel's nearer edge.
    """

    first: float
    last: float
    shift: float
    outward: bool

    def excess(self, kind: str, settings: HandleSettings) -> float:
        """Return by how much it is longer than a kind of handle, metres."""
        if kind == "knob":
            expected = settings.knob + abs(self.shift)
        else:
            expected = settings.lever + (0.0 if self.outward else abs(self.shift))
        return self.last - self.first - expected

    def middle(self, kind: str, settings: HandleSettings) -> float:
        """Return where the middle of a kind of handle is seen, metres along the panel."""
        length = self.last - self.first
        if kind == "knob" or not self.outward:
            length = max(length - abs(self.shift), settings.knob)
        return self.last - 0.5 * length if self.shift > 0.0 else self.first + 0.5 * length


def kind_of(seen: Span, lever_odds: float, settings: HandleSettings) -> tuple[str, float, float]:
    """Return what is seen, where its middle is, and the deviation of that, metres.

    Length and network speak for a lever or a knob; where neither is sure, the middle may be that
    of the other kind.

    Parameters
    ----------
    lever_odds
        How much likelier than a knob a lever is to the network; 1 without one.
    """
    excess = np.array([seen.excess(kind, settings) for kind in ("knob", "lever")])
    evidence = float(np.diff(-(excess**2))[0]) / (2.0 * settings.length_deviation**2)
    most = np.log(settings.max_odds)
    evidence += float(np.clip(np.log(lever_odds), -most, most))
    kinds = ("lever", "knob") if evidence > 0.0 else ("knob", "lever")
    at, other = (seen.middle(kind, settings) for kind in kinds)
    doubt = 1.0 / (1.0 + np.exp(abs(evidence)))
    apart = np.sqrt(doubt * (1.0 - doubt)) * (other - at)
    return kinds[0], at, float(np.hypot(settings.along_noise, apart))
