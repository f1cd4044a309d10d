"""The limit of what a view shows: the door as it is measured by who is told its edges.

What separates an estimate from it is the choice of lines; what remains is noise, calibration, and
how far the measurement uses what there is.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from kmn_perception.doors.candidates import Candidate
from kmn_perception.doors.door_finder import DoorFinder
from kmn_perception.doors.lines import Line, cut_to_pieces, find_lines
from kmn_perception.doors.measuring import measure
from kmn_perception.doors.verdict import judge
from kmn_perception.doors.view_cells import cells_of
from kmn_perception.doors.wall_view import WallFrame, WallView
from kmn_perception.doors.walls import Frame, NoWallError, find_walls
from kmn_perception.evaluation.doors.errors import UNITS, DoorErrors, errors
from kmn_perception.evaluation.doors.label import DoorLabel
from kmn_perception.evaluation.doors.settings import DoorErrorSettings
from kmn_perception.model.room_model import RoomModel
from kmn_perception.network.wall_network import propose

_DISTANCE = list(UNITS).index("distance")


def errors_at_limit(
    finder: DoorFinder,
    frame: Frame,
    label: DoorLabel,
    model: RoomModel,
    settings: DoorErrorSettings,
) -> DoorErrors | None:
    """Return the errors of a door whose edges are told, or None if it cannot be measured.

    On each wall the lines nearest to the true edges are taken; of the walls, the one that gives the
    best distance of the panel.
    """
    try:
        walls = find_walls(frame, finder.settings, np.random.default_rng(finder.seed))
    except NoWallError:
        return None
    found = []
    for view in walls.views:
        told = _told(view, finder, label)
        if told is None:
            continue
        measured = measure(frame, walls.blocks, told, walls.height_source, finder.settings)
        if measured is not None:
            found.append(errors(judge(measured, finder.settings), label, model, settings))
    return min(found, key=lambda off: abs(off.values[_DISTANCE]), default=None)


def _told(view: WallView, finder: DoorFinder, label: DoorLabel) -> Candidate | None:
    """Return the pair of lines at the true edges; None where these are out of the view."""
    settings, noise = finder.settings, finder.settings.fit.pixel_noise
    before = settings.view.before * noise
    pieces = cut_to_pieces(view, before, settings.view.behind * noise, settings.lines)
    lines, edges = find_lines(pieces, settings.lines), []
    for edge in label.edges:
        if edge is None:
            return None
        places = _seen_at(0.5 * (edge.top + edge.bottom), view.frame)
        columns = np.rint((places - view.s[0]) / (view.s[1] - view.s[0])).astype(int)
        if not (columns.min() >= 0 and columns.max() < len(view.s)):
            return None
        reach = settings.reveal.line / (view.s[1] - view.s[0])
        near = [line for line in lines if np.abs(line.column - columns).min() <= reach]
        unmarked = Line(int(columns[0]), 1, 0.0, 0.0, float(pieces.step[columns[0]]))
        edges.append(max(near, key=lambda line: line.contrast, default=unmarked))
    if not edges[0].column < edges[1].column:
        return None
    proposals = None
    if finder.network is not None and view.grey is not None:
        proposals = propose(finder.network, cells_of(view, noise, before))
    return Candidate(0.0, view, pieces, edges[0], edges[1], lines, np.nan, proposals)


def _seen_at(point: NDArray[np.float64], wall: WallFrame) -> NDArray[np.float64]:
    """Return where (2,) a panel's edge (3,) is seen along the wall, and the frame's before it."""
    away, along = -float(point @ wall.normal), float(point @ wall.right)
    return np.array([along * wall.distance / away, along])
