"""Whose an upright edge is, among lines side by side, and where that puts the door."""

from __future__ import annotations

from collections.abc import Mapping
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from kmn_perception.doors.candidates import Candidate
from kmn_perception.doors.lines import Line
from kmn_perception.doors.plan import Plan
from kmn_perception.doors.readings import EdgeReading, read_edges
from kmn_perception.doors.settings import DoorSettings
from kmn_perception.doors.view_cells import cell_of
from kmn_perception.doors.wall_view import WallFrame, WallView
from kmn_perception.network.wall_network import EDGES, Proposals

SETTINGS = DoorSettings.load()
DISTANCE, PIXEL = 2.0, 0.005  # of the wall, metres
LEFT, RIGHT = -0.3, 0.6  # the door's edges along it
AXES = np.array([0.0, 0.0, -1.0]), np.array([1.0, 0.0, 0.0]), np.array([0.0, -1.0, 0.0])
CELLS = 200


def plan(recess: float = 0.0, opening: float = 0.0, hinge: str = "") -> Plan:
    """Return wall and panel; an open one turns about its left edge, away from the camera."""
    turn = np.array([-np.sin(opening), np.cos(opening)])  # the panel's normal
    pivot = np.array([LEFT, DISTANCE + recess])
    return Plan(np.array([0.0, 1.0 / DISTANCE]), turn / (turn @ pivot), 0.0, hinge)


def candidate(
    contrasts: Mapping[float, float],
    at: float = RIGHT,
    seen: Mapping[str, float | None] | None = None,
) -> Candidate:
    """Return a candidate with a clear left edge, the right one of which is seen at a place.

    Parameters
    ----------
    contrasts
        Of the lines near the right edge, by where they are seen along the wall, metres.
    seen
        Where a network sees the edges, by name, see ``EDGES``; None: not. Without it no network.
    """
    s, z = (np.arange(*ends, dtype=np.float64) for ends in ((-2.0, 2.0, PIXEL), (2.5, 2.0, -PIXEL)))
    shape = (100, len(s))
    view = WallView(
        WallFrame(*AXES, DISTANCE, 1.2), s, z,
        np.zeros(shape, np.float32), np.zeros(shape, np.float32), np.ones(shape, np.bool_), 0 * s,
    )  # fmt: skip

    def line(place: float, contrast: float) -> Line:
        return Line(int(np.searchsorted(s, place - 1e-9)), 1, contrast, 1.0, 0.0)

    lines = [line(place, contrast) for place, contrast in sorted(contrasts.items())]
    left = line(LEFT, 0.3)
    right = lines[sorted(contrasts).index(at)] if at in contrasts else line(at, 0.0)
    proposals = None
    if seen is not None:
        maps = np.zeros((len(EDGES), CELLS + 1), np.float32)
        for name, place in {"left": LEFT, "panel_left": LEFT, **seen}.items():
            cell = -1 if place is None else round(cell_of(view, (place - s[0]) / PIXEL))
            maps[EDGES.index(name), cell] = 1.0
        none: Any = np.zeros((3, 64, CELLS), np.float32)
        proposals = Proposals(maps, none[0], none)
    pieces: Any = SimpleNamespace(step=np.zeros(len(s)))
    return Candidate(0.0, view, pieces, left, right, [left, *lines], np.nan, proposals)


def right_edge(found: Candidate, scene: Plan) -> EdgeReading:
    edges = read_edges(found, scene, SETTINGS)
    assert edges is not None
    return edges["right"]


def seen_on_wall(point: np.ndarray) -> float:
    """Return where the ray through a point meets the wall, rounded to the view's columns."""
    return float(np.round(point[0] * DISTANCE / point[1] / PIXEL) * PIXEL)


def test_an_edge_alone_has_no_rival() -> None:
    edge = right_edge(candidate({RIGHT: 0.1}), plan())
    assert edge.place == pytest.approx(RIGHT)
    assert edge.spread == 0.0


def test_equal_lines_beside_each_other_are_rivals() -> None:
    """Of two lines that are as likely, the taken one's mean squared error is half the gap's."""
    edge = right_edge(candidate({RIGHT: 0.1, RIGHT + 0.1: 0.1}), plan())
    assert edge.spread == pytest.approx(0.1 / np.sqrt(2.0), rel=0.05)


def test_a_line_that_the_network_sees_has_no_clear_but_unlikely_rival() -> None:
    """The network has seen how clear both are: a frame's edge is clear, and is not the panel's."""
    lines = {RIGHT: 0.04, RIGHT + 0.115: 0.8}
    assert right_edge(candidate(lines), plan()).place == pytest.approx(RIGHT + 0.115)
    edge = right_edge(candidate(lines, seen={"right": RIGHT, "panel_right": RIGHT}), plan())
    assert edge.place == pytest.approx(RIGHT, abs=PIXEL)
    assert edge.spread < 0.005


def test_the_network_moves_an_edge_to_the_line_that_it_sees() -> None:
    lines = {RIGHT: 0.1, RIGHT - 0.08: 0.3}
    seen = {"right": RIGHT, "panel_right": RIGHT}
    edge = right_edge(candidate(lines, at=RIGHT - 0.08, seen=seen), plan())
    assert edge.place == pytest.approx(RIGHT, abs=PIXEL)


def test_where_frame_and_panel_are_alike_the_network_alone_tells_the_edge() -> None:
    seen = {"right": RIGHT, "panel_right": RIGHT}
    edge = right_edge(candidate({RIGHT + 0.1: 0.02}, at=RIGHT + 0.1, seen=seen), plan())
    assert edge.place == pytest.approx(RIGHT, abs=0.02)
    assert edge.line.contrast == 0.0


def test_where_the_network_sees_frame_and_panel_elsewhere_the_deviation_is_wide() -> None:
    """With a fifth of each, 10 cm beside the line: as likely as their product, 0.04 to 0.64."""
    seen = {"right": RIGHT, "panel_right": RIGHT}
    sure = candidate({RIGHT: 0.1}, seen=seen)
    share = 0.04 / (0.04 + 0.64)
    for names, expected in ((tuple(seen), 0.1 * np.sqrt(share)), (("right",), 0.0)):
        assert sure.proposals is not None
        maps = sure.proposals.edges.copy()
        for name in names:
            row = maps[EDGES.index(name)]
            at = int(row.argmax())
            row[[at, at + 5]] = 0.8, 0.2
        doubted = sure._replace(proposals=sure.proposals._replace(edges=maps))
        assert right_edge(doubted, plan()).spread == pytest.approx(expected, abs=0.005)


@pytest.mark.parametrize("networked", [True, False])
def test_both_lines_of_a_reveal_put_the_edge_at_the_same_place(networked: bool) -> None:
    """At depth d behind the wall a point at s is seen at s D / (D + d): inside of the frame's."""
    recess = 0.1
    own = seen_on_wall(np.array([RIGHT, DISTANCE + recess]))
    lines = {RIGHT: 0.1, own: 0.1}
    seen = {"right": RIGHT, "panel_right": own} if networked else None
    for at in lines:
        edge = right_edge(candidate(lines, at=at, seen=seen), plan(recess))
        assert edge.place == pytest.approx(RIGHT, abs=0.012 if networked else 0.02)
        assert edge.panel_from("right") < edge.wall_from("right")
    assert edge.spread < 0.01 or not networked


@pytest.mark.parametrize("side_seen", ["right", "panel_right"])
def test_the_network_tells_whose_a_lonely_line_is(side_seen: str) -> None:
    """Read as the panel's, a line puts the edge farther out than read as the frame's."""
    recess, other = 0.1, "panel_right" if side_seen == "right" else "right"
    edge = right_edge(candidate({RIGHT: 0.1}, seen={side_seen: RIGHT, other: None}), plan(recess))
    if side_seen == "right":
        assert edge.on_panel < 0.1
        assert edge.place == pytest.approx(RIGHT, abs=PIXEL)
    else:
        assert edge.on_panel > 0.9
        assert edge.place == pytest.approx(RIGHT * (DISTANCE + recess) / DISTANCE, abs=PIXEL)


def test_without_a_network_it_stays_open_whose_a_lonely_line_is() -> None:
    edge = right_edge(candidate({RIGHT: 0.1}), plan(0.1))
    assert edge.on_panel == pytest.approx(0.5)
    assert edge.doubt == pytest.approx(0.5)


def test_a_frame_hides_the_panels_edge_on_the_side_that_the_camera_looks_past() -> None:
    """Of a recessed door that is right of the camera the left edge is behind its frame's."""
    near = 0.5
    found = candidate({1.4: 0.1}, at=1.4)
    left = Line(int(np.searchsorted(found.view.s, near - 1e-9)), 1, 0.3, 1.0, 0.0)
    edges = read_edges(found._replace(left=left, lines=[left, found.right]), plan(0.1), SETTINGS)
    assert edges is not None
    assert edges["left"].on_panel < 0.1
    assert edges["left"].place == pytest.approx(near, abs=PIXEL)
    assert edges["left"].panel_from("left") == pytest.approx(near / DISTANCE, abs=PIXEL)


@pytest.mark.parametrize("of", ["frame", "panel"])
def test_the_swung_edge_of_an_open_panel_is_as_far_from_its_hinge_as_the_frames(of: str) -> None:
    opening = 0.3
    own = np.array([LEFT, DISTANCE]) + (RIGHT - LEFT) * np.array([np.cos(opening), np.sin(opening)])
    at = RIGHT if of == "frame" else seen_on_wall(own)
    seen = {"right": RIGHT, "panel_right": seen_on_wall(own)}
    edge = right_edge(candidate({at: 0.1}, at=at, seen=seen), plan(0.0, opening, "left"))
    assert edge.place == pytest.approx(RIGHT, abs=0.012)
    assert edge.on_panel == pytest.approx(0.0 if of == "frame" else 1.0, abs=0.15)
    assert edge.panel == pytest.approx(own[0] / own[1], abs=0.01)
