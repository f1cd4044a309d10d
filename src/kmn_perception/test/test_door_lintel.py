"""The top of a door in the view of a wall."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from kmn_perception.doors.candidates import Candidate
from kmn_perception.doors.lines import Line
from kmn_perception.doors.lintel import Lintel, find_lintel, usual_top
from kmn_perception.doors.settings import DoorSettings
from kmn_perception.doors.wall_view import WallFrame, WallView

SETTINGS = DoorSettings.load()
LEFT, RIGHT, TOP = -0.45, 0.45, 2.0  # of the panel, metres
AXES = np.array([0.0, 0.0, -1.0]), np.array([1.0, 0.0, 0.0]), np.array([0.0, -1.0, 0.0])


def lintel_of(shades: list[tuple[float, float]]) -> Lintel:
    """Return the top of a panel about which rectangles lie: their margins and shades."""
    s = np.arange(-1.0, 1.0, 0.005, dtype=np.float64)
    z = np.arange(2.5, -0.05, -0.005, dtype=np.float64)
    grey = np.zeros((len(z), len(s)), np.float32)
    for margin, shade in sorted(shades, reverse=True):
        inside = (s > LEFT - margin) & (s < RIGHT + margin)
        grey[np.ix_(z < TOP + margin, inside)] = shade
    everywhere = np.ones(grey.shape, np.bool_)
    view = WallView(WallFrame(*AXES, 2.0, 1.2), s, z, grey, 0.0 * grey, everywhere, 0.003 + 0 * s)
    left, right = (Line(int(np.searchsorted(s, x)), 1, 1.0, 1.0, 0.0) for x in (LEFT, RIGHT))
    unused: Any = None
    candidate = Candidate(0.0, view, unused, left, right, [left, right])
    return find_lintel(candidate, SETTINGS.lintel.heights, SETTINGS.lintel)


def test_the_top_of_a_panel_without_a_frame_is_seen() -> None:
    lintel = lintel_of([(0.0, 0.5)])
    assert lintel.z == pytest.approx(TOP, abs=0.01)
    assert lintel.deviation < 0.02


@pytest.mark.parametrize("frame", [0.06, 0.1])
@pytest.mark.parametrize("panel", [0.3, 0.8, 1.3])
def test_the_top_of_a_clearer_frame_is_not_the_panels(frame: float, panel: float) -> None:
    """The panel's top ends at its upright edges, the frame's goes on to the frame's own."""
    lintel = lintel_of([(0.0, panel), (frame, 1.0)])
    assert lintel.z == pytest.approx(TOP, abs=0.01)


def test_a_top_that_was_not_found_is_above_what_is_seen_or_was_missed() -> None:
    """Of a half-normal above the mean; and with all missed it is as usual, wherever it is seen."""
    usual = (2.05, 0.13)
    value, deviation = usual_top(usual[0], usual, 0.0)
    assert value == pytest.approx(usual[0] + usual[1] * np.sqrt(2.0 / np.pi), abs=2e-3)
    assert deviation == pytest.approx(usual[1] * np.sqrt(1.0 - 2.0 / np.pi), abs=2e-3)
    assert usual_top(2.5, usual, 1.0) == pytest.approx(usual, abs=2e-3)
    high, wide = usual_top(2.25, usual, 0.1)
    assert high < 2.2
    assert wide > deviation
