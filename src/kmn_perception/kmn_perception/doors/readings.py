"""Whose an upright line is: the edge of what is around the door, or the panel's own behind it.

A line tells where the door's edge is along the wall only together with whose it is: the edge of
the frame (or of the wall, where there is none) is seen before a recessed panel, and an open panel's
edge is elsewhere than its frame's. Each line can be read in both ways; a reading says where the
other edge must be seen, or that it is hidden, and is as likely as what is seen there.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from kmn_perception.doors.candidates import Candidate
from kmn_perception.doors.edge_doubt import doubt_of
from kmn_perception.doors.lines import Line
from kmn_perception.doors.plan import OUTWARD, Plan
from kmn_perception.doors.proposals import (
    PanelOrFrame,
    edge_at,
    none_seen,
    peaks_of,
    weight_of,
)
from kmn_perception.doors.settings import DoorSettings


class EdgeReading(NamedTuple):
    """An upright edge of a door as it was read.

    Attributes
    ----------
    line
        The line that tells it.
    place
        Of the edge, along the wall, metres.
    on_panel, doubt
        Whether the line is the panel's own (1) or the frame's (0), and the deviation of that.
    spread
        How far off other lines would put the edge, metres.
    frame, panel
        Directions in which both edges are, metres to the right per metre away, and whether the
        panel's is before the frame's.
    """

    line: Line
    place: float
    on_panel: float
    doubt: float
    spread: float
    frame: float
    panel: float
    is_before: bool

    def panel_from(self, side: str) -> float:
        """Return the direction from which the panel is seen, inwards from a side."""
        if self.is_before:
            return self.panel
        return max(self.frame, self.panel) if side == "left" else min(self.frame, self.panel)

    def wall_from(self, side: str) -> float:
        """Return the direction from which frame or wall are seen, outwards to a side."""
        return min(self.frame, self.panel) if side == "left" else max(self.frame, self.panel)


class _Reading(NamedTuple):
    """A line, whose it is taken for, the place that follows, and the weight."""

    line: Line
    of: PanelOrFrame
    place: float
    weight: float


def read_edges(
    candidate: Candidate, plan: Plan, settings: DoorSettings
) -> dict[str, EdgeReading] | None:
    """Return how the ``left`` and ``right`` edge of a candidate are read; None if they cannot be.

    The hinged edge of an open panel comes first: on it depends where the other one is.
    """
    sides = ("right", "left") if plan.hinge == "right" else ("left", "right")
    found: dict[str, EdgeReading] = {}
    for side in sides:
        hinge_place = found[plan.hinge].place if plan.hinge in found else 0.0
        edge = _read(candidate, side, plan, hinge_place, settings)
        if edge is None:
            return None
        found[side] = edge
    return found if found["left"].line.column < found["right"].line.column else None


def _read(
    candidate: Candidate, side: str, plan: Plan, hinge_place: float, settings: DoorSettings
) -> EdgeReading | None:
    readings = [
        reading
        for line, ways in _lines(candidate, side, settings)
        for reading in _readings(candidate, side, line, ways, plan, hinge_place, settings)
    ]
    if not readings:
        return None
    weights: dict[Line, float] = {}
    for reading in readings:
        weights[reading.line] = weights.get(reading.line, 0.0) + reading.weight
    line = max(weights, key=lambda one: weights[one])
    own = {reading.of: reading for reading in readings if reading.line == line}
    total = weights[line]
    share = own["panel"].weight / total if "panel" in own else 0.0
    place = sum(reading.weight * reading.place for reading in own.values()) / total
    spread = sum(
        reading.weight * (reading.place - place) ** 2
        for reading in readings
        if reading.line != line
    ) / sum(weights.values())
    spread += doubt_of(candidate, side, plan, place, hinge_place, settings) ** 2
    doubt = max(np.sqrt(share * (1.0 - share)), settings.reveal.least_doubt)
    frame, panel = plan.frame_at(place), plan.panel_at(side, place, hinge_place)
    return EdgeReading(
        line,
        place,
        share,
        float(doubt),
        float(np.sqrt(spread)),
        float(frame[0] / frame[1]),
        float(panel[0] / panel[1]),
        plan.behind(panel) < 0.0,
    )


def _lines(
    candidate: Candidate, side: str, settings: DoorSettings
) -> Iterator[tuple[Line, tuple[PanelOrFrame, ...]]]:
    """Yield the lines that may be an edge, and whose each may be."""
    chosen, view = candidate.edge(side), candidate.view
    pixel = float(view.s[1] - view.s[0])
    yield chosen, ("frame", "panel")
    taken = [chosen]
    for line in candidate.lines:
        near = abs(line.column - chosen.column) * pixel <= settings.lines.rivals
        if near and line != chosen and line.coverage >= settings.verdict.min_coverage:
            taken.append(line)
            yield line, ("frame", "panel")
    # Where frame and panel are alike, the network alone may see an edge.
    for of in ("frame", "panel"):
        for column in peaks_of(candidate, side, of, settings):
            least = 0.5 * edge_at(candidate, side, of, column, settings)
            shown = any(
                abs(column - line.column) * pixel <= settings.network.snap
                and edge_at(candidate, side, of, line.column, settings) >= least
                for line in taken
            )
            if not shown and abs(column - chosen.column) * pixel <= settings.lines.rivals:
                step = float(candidate.pieces.step[column])
                yield Line(column, 1, 0.0, 0.0, step), (of,)


def _readings(
    candidate: Candidate,
    side: str,
    line: Line,
    ways: tuple[PanelOrFrame, ...],
    plan: Plan,
    hinge_place: float,
    settings: DoorSettings,
) -> Iterator[_Reading]:
    """Yield the readings of a line, with their weights."""
    view = candidate.view
    pixel, distance = float(view.s[1] - view.s[0]), view.frame.distance
    direction = float(view.s[line.column]) / distance
    clarity = max(
        line.contrast + settings.network.step * abs(line.step), settings.lines.min_contrast
    )
    for of in ways:
        if of == "frame":
            place = plan.place_of_frame(direction)
        else:
            place = plan.place_of_panel(side, direction, hinge_place)
        panel = plan.panel_at(side, place, hinge_place)
        other = panel if of == "frame" else plan.frame_at(place)
        if other[1] <= 0.0 or panel[1] <= 0.0:
            continue
        column = (other[0] / other[1] * distance - float(view.s[0])) / pixel
        # What is farther out hides the one that is behind it.
        outward = OUTWARD[side] * (column - line.column) * pixel
        apart = abs(outward) > settings.reveal.line
        panel_is_out = outward > 0.0 if of == "frame" else outward < 0.0
        hidden: PanelOrFrame | None = None
        if apart and panel_is_out:
            hidden = "panel" if plan.behind(panel) > 0.0 else "frame"
        probability = edge_at(candidate, side, of, line.column, settings)
        partner: PanelOrFrame = "panel" if of == "frame" else "frame"
        seen = edge_at(candidate, side, partner, round(column), settings)
        if hidden == partner:
            seen = max(seen, none_seen(candidate, side, partner))
        elif hidden == of:
            probability *= settings.network.unlikely
        elif apart and not _is_line(candidate, column, settings):
            probability *= settings.reveal.unmarked
        weight = weight_of(clarity, probability * seen, settings)
        yield _Reading(line, of, place, weight)


def _is_line(candidate: Candidate, column: float, settings: DoorSettings) -> bool:
    """Return whether a line is seen at a column of the view."""
    view = candidate.view
    reach = settings.reveal.line / float(view.s[1] - view.s[0])
    return any(
        abs(line.column - column) <= reach and line.coverage >= settings.verdict.min_coverage
        for line in candidate.lines
    )
