"""The limit of what a view shows: the door as it is measured by who is told its edges.

What separates an estimate from it is the choice of lines; what remains is noise, calibration, and
how far the measurement uses what there is.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from kmn_perception.doors.candidates import Candidate
from kmn_perception.doors.door_finder import DoorFinder
from kmn_perception.doors.lines import Line, cut_to_pieces, find_lines
from kmn_perception.doors.measuring import measure
from kmn_perception.doors.verdict import judge
from kmn_perception.doors.view_cells import cell_of, cells_of
from kmn_perception.doors.wall_view import WallView
from kmn_perception.doors.walls import Frame, NoWallError, find_walls
from kmn_perception.evaluation.doors.errors import UNITS, DoorErrors, errors
from kmn_perception.evaluation.doors.label import DoorLabel
from kmn_perception.evaluation.doors.settings import DoorErrorSettings
from kmn_perception.model.room_model import RoomModel
from kmn_perception.network.wall_network import EDGES, KINDS, ROWS, Proposals, propose
from kmn_perception.rooms import frame as rendered
from kmn_perception.rooms.design import EDGES as ENDS
from kmn_perception.rooms.design import seen_opening, seen_panel_edges
from kmn_perception.rooms.label import VISIBLE

_DISTANCE = list(UNITS).index("distance")
_SPREAD = 0.8  # cells, of the edges that are told


def errors_at_limit(
    finder: DoorFinder,
    frame: Frame,
    truth: rendered.Frame,
    label: DoorLabel,
    model: RoomModel,
    settings: DoorErrorSettings,
) -> DoorErrors | None:
    """Return the errors of a door whose edges are told, or None if it cannot be measured.

    On each wall it is told where the edges of frame and panel are, as a perfect network would; of
    the walls the one counts that gives the best distance of the panel.
    """
    try:
        walls = find_walls(frame, finder.settings, np.random.default_rng(finder.seed))
    except NoWallError:
        return None
    edges, found = _edges(truth), []
    for view in walls.views(frame, finder.settings):
        told = _told(view, finder, edges)
        if told is None:
            continue
        measured = measure(frame, walls.blocks, told, walls.height_source, finder.settings)
        if measured is not None:
            found.append(errors(judge(measured, finder.settings), label, model, settings))
    return min(found, key=lambda off: abs(off.values[_DISTANCE]), default=None)


def _edges(truth: rendered.Frame) -> Mapping[str, NDArray[np.float64]]:
    """Return the middles (3,) of the edges that are seen, by their names in ``EDGES``."""
    door, room, bodies = truth.room.door, truth.room, truth.images.bodies
    assert door is not None
    around, own = seen_opening(door, room, bodies), seen_panel_edges(door, room, bodies)
    return {
        prefix + side: np.mean([corners[name] for name in ENDS[side]], axis=0)
        for prefix, corners, seen in (("", door.opening, around), ("panel_", door.corners, own))
        for side in ("left", "right")
        if seen[side] >= VISIBLE
    }


def _told(
    view: WallView, finder: DoorFinder, edges: Mapping[str, NDArray[np.float64]]
) -> Candidate | None:
    """Return the pair of lines at the true edges; None where these are out of the view."""
    settings, noise = finder.settings, finder.settings.fit.pixel_noise
    before = settings.view.before * noise
    pieces = cut_to_pieces(view, before, settings.view.behind * noise, settings.lines)
    lines = find_lines(pieces, settings.lines)
    columns = {name: _seen_at(point, view) for name, point in edges.items()}
    chosen = []
    for side in ("left", "right"):
        column = columns.get(side, columns.get(f"panel_{side}"))
        if column is None or not 0.0 <= column < len(view.s) - 1.0:
            return None
        reach = settings.reveal.line / (view.s[1] - view.s[0])
        near = [line for line in lines if abs(line.column - column) <= reach]
        at = round(column)
        unmarked = Line(at, 1, 0.0, 0.0, float(pieces.step[at]))
        chosen.append(max(near, key=lambda line: line.contrast, default=unmarked))
    if not chosen[0].column < chosen[1].column:
        return None
    proposals = None
    if view.grey is not None:
        cells = cells_of(view, noise, before)
        count = cells.shape[2]
        maps = np.array([_map(view, columns.get(name), count) for name in EDGES], np.float32)
        proposals = Proposals(
            maps,
            np.zeros((ROWS, count), np.float32),
            np.zeros((len(KINDS), ROWS, count), np.float32),
        )
        if finder.network is not None:
            proposals = propose(finder.network, cells)._replace(edges=maps)
    return Candidate(0.0, view, pieces, chosen[0], chosen[1], lines, np.nan, proposals)


def _map(view: WallView, column: float | None, count: int) -> NDArray[np.float64]:
    """Return probabilities (count + 1,) of an edge at a column of the view; the last: not seen."""
    answer = np.zeros(count + 1)
    if column is not None:
        cells = np.arange(count)
        answer[:-1] = np.exp(-0.5 * ((cells - cell_of(view, column)) / _SPREAD) ** 2)
        answer[:-1] /= max(float(answer.sum()), 1e-9)
    answer[-1] = 1.0 - answer[:-1].sum()
    return answer


def _seen_at(point: NDArray[np.float64], view: WallView) -> float:
    """Return the column of the view in which a point (3,) is seen."""
    wall = view.frame
    along = float(point @ wall.right) * wall.distance / -float(point @ wall.normal)
    return (along - float(view.s[0])) / float(view.s[1] - view.s[0])
