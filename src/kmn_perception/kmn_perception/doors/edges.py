"""The upright edges of a candidate: their directions, finely, and how sure their place is."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from kmn_perception.doors.candidates import Candidate
from kmn_perception.doors.lines import Line, Pieces, gaussian_steps
from kmn_perception.doors.proposals import near, weight_of
from kmn_perception.doors.settings import DoorSettings
from kmn_perception.doors.view_cells import cell_of
from kmn_perception.doors.wall_view import WallView


def measure_edge(candidate: Candidate, side: str, settings: DoorSettings) -> tuple[float, float]:
    """Return the direction of an edge and its standard deviation, if it is the door's.

    Returns
    -------
    direction, deviation
        Metres to the right per metre away from the camera.
    """
    line, distance = candidate.edge(side), candidate.view.frame.distance
    noise = settings.fit.edge_noise * float(candidate.view.footprint[line.column])
    if line.contrast == 0.0:
        place, scatter = (
            float(candidate.view.s[line.column]),
            3.0 * noise + settings.fit.step_edge_noise,
        )
    else:
        place, scatter = _subpixel(candidate.view, candidate.pieces, line, settings)
    return place / distance, float(np.hypot(noise, scatter)) / distance


def rivals(candidate: Candidate, side: str, pair: Sequence[float], settings: DoorSettings) -> float:
    """Return how far other lines that may be the edge lie from the one that was taken, metres.

    Frame, panel and what stands beside them have edges side by side. Each counts by how
    clear it is and, with a network, how probably the door's, see `weight_of`.

    Parameters
    ----------
    pair
        Where the other edge of the same reveal is seen, see `reveal_pair`; that is no rival.
    """
    chosen, view = candidate.edge(side), candidate.view
    pixel = float(view.s[1] - view.s[0])
    weights, offsets = [], []
    for line in candidate.lines:
        offset = (line.column - chosen.column) * pixel
        if abs(offset) > settings.lines.rivals or line.coverage < settings.verdict.min_coverage:
            continue
        place = float(view.s[line.column])
        if line.column != chosen.column and any(
            abs(place - other) <= settings.reveal.line for other in pair
        ):
            continue
        probability = _probability(candidate, side, line.column, settings)
        weights.append(weight_of(line.contrast, probability, settings))
        offsets.append(offset)
    if not sum(weights):
        return 0.0
    return float(np.sqrt(np.average(np.square(offsets), weights=weights)))


def reveal_pair(candidate: Candidate, side: str, depth: float) -> tuple[float, float]:
    """Return where the other edge of a reveal would be seen along the wall, metres.

    Behind a frame's edge in sight the panel's own appears nearer to the middle, before a panel's
    edge the frame's farther out.

    Parameters
    ----------
    depth
        Of the panel behind the wall's face, metres.
    """
    view = candidate.view
    place, distance = float(view.s[candidate.edge(side).column]), view.frame.distance
    return place * distance / (distance + depth), place * (distance + depth) / distance


def both_seen(
    candidate: Candidate, side: str, pair: tuple[float, float], settings: DoorSettings
) -> tuple[float, float]:
    """Return whether an edge is the frame's (0) or the panel's own (1), and the deviation.

    Where the other line of the pair is, and where the network sees the door's edge, tells which of
    the two was taken.

    Parameters
    ----------
    pair
        Where the panel's edge would be seen, and where the frame's, see `reveal_pair`.
    """
    view, line = candidate.view, candidate.edge(side)
    pixel, (inner, outer) = float(view.s[1] - view.s[0]), pair

    def column(s: float) -> int:
        return round((s - float(view.s[0])) / pixel)

    def is_line(s: float) -> bool:
        reach = settings.reveal.line / pixel
        return any(
            abs(other.column - column(s)) <= reach < abs(other.column - line.column)
            and other.coverage >= settings.verdict.min_coverage
            for other in candidate.lines
        )

    unmarked = settings.reveal.unmarked
    own = _probability(candidate, side, line.column, settings)
    own *= 1.0 if is_line(outer) else unmarked
    frame = _probability(candidate, side, column(inner), settings)
    frame *= 1.0 if is_line(inner) else unmarked
    share = own / (own + frame)
    return share, max(float(np.sqrt(share * (1.0 - share))), settings.reveal.hidden[1])


def _probability(candidate: Candidate, side: str, column: int, settings: DoorSettings) -> float:
    """Return the network's probability that the door's edge is there; 1 without a network."""
    if candidate.proposals is None:
        return 1.0
    found = candidate.proposals.left if side == "left" else candidate.proposals.right
    return near(found, round(cell_of(candidate.view, column)), 1) + settings.network.unlikely


def _subpixel(
    view: WallView, pieces: Pieces, line: Line, settings: DoorSettings
) -> tuple[float, float]:
    """Return the place of an edge and the standard deviation of its mean, metres."""
    assert view.grey is not None
    fine = settings.lines.fine_smoothing
    reach = round(0.5 * settings.lines.tie / float(view.s[1] - view.s[0])) + int(np.ceil(3 * fine))
    first = max(line.column - reach, 0)
    columns = slice(first, line.column + reach + 1)
    places = []
    for k in np.flatnonzero(pieces.body):
        if not pieces.known[k, columns].mean() > 0.7:
            continue
        shade = view.grey[pieces.rows == k, columns].mean(axis=0)
        profile = line.sign * gaussian_steps(shade[None], fine)[0]
        near = np.abs(first + np.arange(len(profile)) - line.column) <= 3
        if profile[near].max() < 0.6 * settings.lines.min_contrast:
            continue
        peak = int(np.where(near, profile, -1.0).argmax())
        window = slice(max(peak - 2, 0), peak + 3)
        weights = np.maximum(profile[window] - 0.5 * profile[peak], 0.0)
        at = first + window.start + np.arange(len(weights))
        places.append(float((weights * at).sum() / weights.sum()))
    pixel = float(view.s[1] - view.s[0])
    if len(places) < 3:
        return float(view.s[line.column]), 2.0 * pixel
    found = np.array(places)
    middle = np.median(found)
    scatter = max(1.48 * float(np.median(np.abs(found - middle))), 0.6)
    near = found[np.abs(found - middle) < 3.0 * scatter]
    spread = float(near.std()) / np.sqrt(max(len(near) / 3.0, 1.0))
    return float(view.s[0] + near.mean() * pixel), spread * pixel
