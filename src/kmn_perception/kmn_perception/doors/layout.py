"""Wall, panel and the edges between them, which depend on each other."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kmn_perception.doors.candidates import Candidate
from kmn_perception.doors.inverse_depth import Blocks
from kmn_perception.doors.plan import Plan
from kmn_perception.doors.proposals import peaks_of
from kmn_perception.doors.readings import EdgeReading, read_edges
from kmn_perception.doors.seen_blocks import FLOOR, PANEL, WALL
from kmn_perception.doors.settings import DoorSettings
from kmn_perception.doors.surfaces import Surfaces, fit_surfaces
from kmn_perception.doors.upright import HeightSource

SIDES = ("left", "right")
OPPOSITE = {"left": "right", "right": "left"}


class Layout(NamedTuple):
    """A candidate's surfaces and edges.

    Attributes
    ----------
    hinges
        Sides at which an open panel may be hinged, the likelier one first; empty if it is closed.
    edges
        How the edges are read if the first of these is the hinge.
    """

    surfaces: Surfaces
    hinges: tuple[str, ...]
    edges: Mapping[str, EdgeReading]


def lay_out(
    blocks: Blocks, candidate: Candidate, height: HeightSource, settings: DoorSettings
) -> Layout | None:
    """Return surfaces and edges of a candidate; None where wall or panel are hardly seen.

    Where the panel is seen follows from whose its edges are, and that from where wall and panel
    are: what is found first is found once more if it is elsewhere.
    """
    spans = _expected(candidate, settings)
    found = _lay_out(blocks, candidate, spans, height, settings)
    if found is None:
        return None
    of_panel = [found.edges[side].panel_from(side) for side in SIDES]
    of_wall = [found.edges[side].wall_from(side) for side in SIDES]
    better = np.array([of_panel, of_wall])
    if np.abs(better - spans).max() * candidate.view.frame.distance > settings.fit.margin:
        return _lay_out(blocks, candidate, better, height, settings) or found
    return found


def read_at(
    hinge: str, candidate: Candidate, surfaces: Surfaces, settings: DoorSettings
) -> Mapping[str, EdgeReading] | None:
    """Return how the edges are read with a hinge at a side; empty: the panel is closed."""
    values = surfaces.values
    plan = Plan(values[WALL], values[PANEL], settings.reveal.proud[0], hinge)
    return read_edges(candidate, plan, settings)


def _expected(candidate: Candidate, settings: DoorSettings) -> NDArray[np.float64]:
    """Return between which directions the panel, and beyond which the wall, may be seen, (2, 2).

    Beside the candidate's edges a network may see the panel's own.
    """
    view, ends = candidate.view, []
    far = 0.5 * (candidate.right.column - candidate.left.column)
    for side in SIDES:
        at = candidate.edge(side).column
        own = peaks_of(candidate, side, "panel", settings)
        columns = [at, *(column for column in own[:1] if abs(column - at) < far)]
        ends.append((float(view.s[min(columns)]), float(view.s[max(columns)])))
    (left_out, left_in), (right_in, right_out) = ends
    return np.array([[left_in, right_in], [left_out, right_out]]) / view.frame.distance


def _lay_out(
    blocks: Blocks,
    candidate: Candidate,
    spans: NDArray[np.float64],
    height: HeightSource,
    settings: DoorSettings,
) -> Layout | None:
    """Return surfaces and edges, if panel and wall are seen in these directions (2, 2)."""
    panel, wall = ((float(left), float(right)) for left, right in spans)
    surfaces = fit_surfaces(
        blocks, candidate.view.frame, panel, wall, height, settings.calibration, settings.fit
    )
    if surfaces is None or not _is_possible(surfaces, panel, settings):
        return None
    hinges = _hinges(surfaces, panel, settings) if surfaces.opening else ()
    edges = read_at(hinges[0] if hinges else "", candidate, surfaces, settings)
    return None if edges is None else Layout(surfaces, hinges, edges)


def _is_possible(
    surfaces: Surfaces, directions: tuple[float, float], settings: DoorSettings
) -> bool:
    """Return whether the camera, above a floor, sees wall and panel in both directions of edges."""
    rays = np.array([[direction, 1.0] for direction in directions])
    seen = np.stack([rays @ surfaces.values[WALL], rays @ surfaces.values[PANEL]])
    reach = settings.view.reach
    return bool((seen > 1.0 / reach).all() and surfaces.values[FLOOR] > 1.0 / reach)


def _hinges(
    surfaces: Surfaces, directions: tuple[float, float], settings: DoorSettings
) -> tuple[str, ...]:
    """Return which sides an open panel may be hinged at, the likelier one first.

    Near its hinge it is in the wall; at the other side it is not.
    """
    low, high = settings.reveal.recess
    wall, panel = surfaces.values[WALL], surfaces.values[PANEL]
    off = {}
    for side, direction in zip(SIDES, directions, strict=True):
        ray = np.array([direction, 1.0])
        depth = float((wall @ ray) / (panel @ ray) - 1.0) / float(np.linalg.norm(wall))
        off[side] = max(low - depth, depth - high)
    nearest = sorted(SIDES, key=lambda side: off[side])
    return tuple(side for side in nearest if side == nearest[0] or off[side] <= 0.0)
