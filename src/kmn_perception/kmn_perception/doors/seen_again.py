"""The edges of a door that was found, in a later frame of a camera that has not moved."""

from __future__ import annotations

from collections.abc import Sequence

from kmn_perception.doors.candidates import Candidate
from kmn_perception.doors.lines import Line, Pieces
from kmn_perception.doors.view_cells import WIDE
from kmn_perception.doors.wall_view import WallView


def columns_about(candidate: Candidate, beside: float) -> slice:
    """Return the columns of a view, in whole cells, from so far (m) beside a door's edges on."""
    view = candidate.view
    margin = round(beside / float(view.s[1] - view.s[0]))
    first = max(candidate.left.column - margin, 0) // WIDE * WIDE
    last = min(candidate.right.column + margin + WIDE, len(view.s)) // WIDE * WIDE
    return slice(first, last)


def seen_again(
    candidate: Candidate,
    view: WallView,
    pieces: Pieces,
    lines: Sequence[Line],
    first: int,
    reach: float,
) -> Candidate | None:
    """Return a candidate in a later view; None where its edges do not show within reach, metres.

    Parameters
    ----------
    view, pieces, lines
        Of the later frame.
    first
        The column of the earlier view with which the later one begins.
    """
    pixels = reach / float(view.s[1] - view.s[0])
    left, right = (
        _same(line._replace(column=line.column - first), pieces, lines, pixels)
        for line in (candidate.left, candidate.right)
    )
    if left is None or right is None or left.column >= right.column:
        return None
    proposals = candidate.proposals
    if proposals is not None:
        proposals = proposals.between(first // WIDE, (first + len(view.s)) // WIDE)
    return candidate._replace(
        view=view, pieces=pieces, lines=lines, left=left, right=right, proposals=proposals
    )


def _same(line: Line, pieces: Pieces, lines: Sequence[Line], reach: float) -> Line | None:
    if line.contrast == 0.0:  # a place at which grey shows no edge
        return line._replace(step=float(pieces.step[line.column]))
    near = (one for one in lines if one.sign == line.sign and one.contrast > 0.0)
    nearest = min(near, key=lambda one: abs(one.column - line.column), default=None)
    if nearest is None or abs(nearest.column - line.column) > reach:
        return None
    return nearest
