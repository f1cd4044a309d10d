"""Whose an upright edge is, among lines side by side."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest

from kmn_perception.doors.candidates import Candidate
from kmn_perception.doors.edges import both_seen, reveal_pair, rivals
from kmn_perception.doors.lines import Line
from kmn_perception.doors.settings import DoorSettings
from kmn_perception.doors.view_cells import cell_of
from kmn_perception.doors.wall_view import WallFrame, WallView
from kmn_perception.network.wall_network import Proposals

SETTINGS = DoorSettings.load()
DISTANCE, PLACE, PIXEL = 2.0, 0.6, 0.005  # of the wall, and of the right edge on it, metres
AXES = np.array([0.0, 0.0, -1.0]), np.array([1.0, 0.0, 0.0]), np.array([0.0, -1.0, 0.0])


def candidate(
    contrasts: Mapping[float, float], seen: Mapping[float, float] | None = None
) -> Candidate:
    """Return a pair of edges of which the right one is at PLACE.

    Parameters
    ----------
    contrasts
        Of lines, by their distance to the right of PLACE, metres; PLACE itself is among them.
    seen
        The network's probability of the right edge, by the same distance; None without a network.
    """
    s, z = (np.arange(*ends, dtype=np.float64) for ends in ((-2.0, 2.0, PIXEL), (2.5, 2.0, -PIXEL)))
    shape = (100, len(s))
    view = WallView(
        WallFrame(*AXES, DISTANCE, 1.2), s, z,
        np.zeros(shape, np.float32), np.zeros(shape, np.float32), np.ones(shape, np.bool_), 0 * s,
    )  # fmt: skip
    lines = [
        Line(int(np.searchsorted(s, PLACE + offset - 1e-9)), 1, contrast, 1.0, 0.0)
        for offset, contrast in sorted(contrasts.items())
    ]
    right = lines[sorted(contrasts).index(0.0)]
    proposals = None
    if seen is not None:
        p = np.zeros(201, np.float32)
        for offset, probability in seen.items():
            p[round(cell_of(view, (PLACE + offset - s[0]) / PIXEL))] += probability
        none: Any = np.zeros((3, 64, 200), np.float32)
        proposals = Proposals(p, p, none[0], none)
    pieces: Any = None
    return Candidate(0.0, view, pieces, lines[0], right, lines, np.nan, proposals)


def test_an_edge_alone_has_no_rival() -> None:
    assert rivals(candidate({0.0: 0.1}), "right", (), SETTINGS) == 0.0


def test_equal_lines_beside_each_other_are_rivals() -> None:
    """Of two lines that are as likely, the taken one's mean squared error is half the gap's."""
    beside = candidate({0.0: 0.1, 0.1: 0.1})
    assert rivals(beside, "right", (), SETTINGS) == pytest.approx(0.1 / np.sqrt(2.0))


def test_a_line_that_the_network_sees_has_no_clear_but_unlikely_rival() -> None:
    """The network has seen how clear both are: a frame's edge is clear, and is not the panel's."""
    faint = {0.0: 0.04, 0.115: 0.8}
    assert rivals(candidate(faint), "right", (), SETTINGS) > 0.1
    assert rivals(candidate(faint, {0.0: 0.93}), "right", (), SETTINGS) < 0.01


def test_the_other_edge_of_the_same_reveal_is_no_rival() -> None:
    pair = reveal_pair(candidate({0.0: 0.1}), "right", 0.1)
    beside = candidate({0.0: 0.1, pair[0] - PLACE: 0.1})
    assert rivals(beside, "right", (), SETTINGS) > 0.01
    assert rivals(beside, "right", pair, SETTINGS) == 0.0


def test_a_reveal_is_seen_between_the_rays_to_frame_and_panel() -> None:
    """By similar triangles: at depth d behind the wall a point at s is seen at s D / (D + d)."""
    depth = 0.1
    inner, outer = reveal_pair(candidate({0.0: 0.1}), "right", depth)
    assert inner == pytest.approx(PLACE * DISTANCE / (DISTANCE + depth))
    assert outer * DISTANCE / (DISTANCE + depth) == pytest.approx(PLACE)


@pytest.mark.parametrize("own", [True, False])
def test_the_other_line_of_a_reveal_tells_whose_edge_was_taken(own: bool) -> None:
    """With the frame's line farther out the taken one is the panel's; with one within, not."""
    inner, outer = reveal_pair(candidate({0.0: 0.1}), "right", 0.1)
    other = (outer if own else inner) - PLACE
    taken = candidate({0.0: 0.1, other: 0.1}, {0.0: 0.5, other: 0.5})
    share, deviation = both_seen(taken, "right", (inner, outer), SETTINGS)
    assert (share > 0.9) if own else (share < 0.6)
    assert deviation >= SETTINGS.reveal.hidden[1]


def test_without_the_other_line_it_stays_open_whose_edge_was_taken() -> None:
    alone = candidate({0.0: 0.1})
    share, deviation = both_seen(alone, "right", reveal_pair(alone, "right", 0.1), SETTINGS)
    assert share == pytest.approx(0.5)
    assert deviation == pytest.approx(0.5)
