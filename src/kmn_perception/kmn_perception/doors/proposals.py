"""Candidates that the network proposes, put onto the edges that the view shows."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kmn_perception.doors.candidates import Candidate, distinct, score_of
from kmn_perception.doors.lines import Line, Pieces
from kmn_perception.doors.settings import DoorSettings
from kmn_perception.doors.view_cells import cell_of, cells_of, column_of, height_of
from kmn_perception.doors.wall_view import WallView
from kmn_perception.network.wall_network import EDGES, KINDS, Proposals, WallNetwork, propose

PanelOrFrame = Literal["frame", "panel"]
_LEAST = 1e-6  # probability of what a network finds impossible
_PEAK = 0.5  # probability of the likeliest cell where a network is sure
_BESIDE = 6  # cells beside an edge where what stands out may be seen


def with_proposals(
    candidates: Sequence[Candidate],
    view: WallView,
    pieces: Pieces,
    lines: Sequence[Line],
    network: WallNetwork,
    settings: DoorSettings,
) -> list[Candidate]:
    """Return candidates with the network's opinion of them, and those that it proposes itself."""
    noise = settings.fit.pixel_noise
    proposals = propose(network, cells_of(view, noise, settings.view.before * noise))
    known = [_judged(candidate, proposals, settings) for candidate in candidates]
    pixel = float(view.s[1] - view.s[0])
    narrow, wide = settings.verdict.width
    slack = settings.lines.tie
    lefts, rights = (
        [
            _edge(view, pieces, lines, p, at, settings)
            for p in (edge_map(proposals, side, "frame"), edge_map(proposals, side, "panel"))
            for at in _peaks(p, settings.network.peaks)
        ]
        for side in ("left", "right")
    )
    for left in dict.fromkeys(lefts):
        for right in dict.fromkeys(rights):
            width = (right.column - left.column) * pixel
            if narrow - slack <= width <= wide + slack:
                score = score_of(left, right, width, lines, pieces, pixel, settings)
                candidate = Candidate(score, view, pieces, left, right, lines)
                known.append(_judged(candidate, proposals, settings))
    known.sort(key=lambda candidate: -candidate.score)
    return distinct(known, slack / pixel)[: settings.candidates]


def _judged(candidate: Candidate, proposals: Proposals, settings: DoorSettings) -> Candidate:
    view = candidate.view
    confidence = 1.0
    for side in ("left", "right"):
        at = round(cell_of(view, candidate.edge(side).column))
        confidence *= _either(proposals, side, at, 1)
    least = settings.network.min_confidence
    opinion = 1.0 - np.log(max(confidence, least)) / np.log(least)
    score = candidate.score + settings.score.network * float(opinion)
    return candidate._replace(score=score, confidence=confidence, proposals=proposals)


class SeenHandle(NamedTuple):
    """A handle that the network sees: its kind, and the middle's place in the view, metres."""

    kind: str
    lever_odds: float  # how much likelier than a knob
    s: float
    z: float
    probability: float


def handle_of(candidate: Candidate) -> SeenHandle | None:
    """Return the likeliest handle between two edges, or near them; None without a network."""
    if candidate.proposals is None:
        return None
    view, cells = candidate.view, candidate.proposals.handle
    first = max(round(cell_of(view, candidate.left.column)) - _BESIDE, 0)
    last = round(cell_of(view, candidate.right.column)) + _BESIDE
    inside = cells[:, :, first : last + 1]
    total = inside.sum(axis=0)
    row, column = divmod(int(total.argmax()), total.shape[1])
    rows = slice(max(row - 2, 0), row + 3)
    columns = slice(max(column - 3, 0), column + 4)
    part = inside[:, rows, columns]
    weights = part.sum(axis=0)
    at = column_of(view, first + columns.start + np.arange(weights.shape[1]))
    s = view.s[0] + np.average(at, weights=weights.sum(axis=0)) * (view.s[1] - view.s[0])
    z = np.average(
        height_of(view, rows.start + np.arange(len(weights))), weights=weights.sum(axis=1)
    )
    by_kind = part.sum(axis=(1, 2)) + _LEAST
    lever, knob = (float(by_kind[KINDS.index(kind)]) for kind in ("lever", "knob"))
    kind = KINDS[int(by_kind.argmax())]
    return SeenHandle(kind, lever / knob, float(s), float(z), float(part.sum()))


def edge_probability(candidate: Candidate, side: str) -> float:
    """Return the network's probability of a candidate's ``left`` or ``right`` edge; 0 without."""
    if candidate.proposals is None:
        return 0.0
    at = round(cell_of(candidate.view, candidate.edge(side).column))
    return _either(candidate.proposals, side, at, 2)


def edge_map(proposals: Proposals, side: str, of: PanelOrFrame) -> NDArray[np.float32]:
    """Return the probabilities (N + 1,) of an edge by column; the last one: it is not seen."""
    return proposals.edges[EDGES.index(side if of == "frame" else f"panel_{side}")]


def edge_at(
    candidate: Candidate, side: str, of: PanelOrFrame, column: float, settings: DoorSettings
) -> float:
    """Return how likely an edge is at a column of the view: 1 where the network is sure.

    Also 1 without a network.
    """
    if candidate.proposals is None:
        return 1.0
    found = edge_map(candidate.proposals, side, of)[:-1]
    at = cell_of(candidate.view, column)
    density = float(np.interp(at, np.arange(len(found)), found, left=0.0, right=0.0))
    return min(density / _PEAK, 1.0) + settings.network.unlikely


def none_seen(candidate: Candidate, side: str, of: PanelOrFrame) -> float:
    """Return the network's probability that an edge is not seen; 0 without a network."""
    if candidate.proposals is None:
        return 0.0
    return float(edge_map(candidate.proposals, side, of)[-1])


def peaks_of(
    candidate: Candidate, side: str, of: PanelOrFrame, settings: DoorSettings
) -> list[int]:
    """Return the columns of the view at which the network sees an edge; none without a network."""
    if candidate.proposals is None:
        return []
    found, columns = edge_map(candidate.proposals, side, of), []
    for at in _peaks(found, settings.network.peaks):
        if _near(found, at, 1) < settings.network.min_peak:
            break
        columns.append(_column(candidate.view, found, at))
    return columns


def _column(view: WallView, probabilities: NDArray[np.float32], at: int) -> int:
    """Return the column of the view in the middle of a peak."""
    cells = np.arange(max(at - 1, 0), min(at + 2, len(probabilities) - 1))
    middle = np.average(cells, weights=probabilities[cells])
    column = round(float(column_of(view, middle)))
    return min(max(column, 0), len(view.s) - 1)


def _either(proposals: Proposals, side: str, at: int, reach: int) -> float:
    """Return the probability that frame or panel has its edge about a column of cells."""
    return max(_near(edge_map(proposals, side, of), at, reach) for of in ("frame", "panel"))


def _near(probabilities: NDArray[np.float32], at: int, reach: int) -> float:
    """Return the probability of the columns about one of them."""
    last = len(probabilities) - 1  # that there is none
    return float(probabilities[max(at - reach, 0) : max(min(at + reach + 1, last), 0)].sum())


def _peaks(probabilities: NDArray[np.float32], count: int) -> list[int]:
    """Return the columns of the largest peaks."""
    p = probabilities[:-1]
    inner = np.pad(p, 1, constant_values=-1.0)
    peaks = np.flatnonzero((p >= inner[:-2]) & (p > inner[2:]) & (p > _LEAST))
    return [int(i) for i in peaks[np.argsort(-p[peaks])][:count]]


def _edge(
    view: WallView,
    pieces: Pieces,
    lines: Sequence[Line],
    probabilities: NDArray[np.float32],
    at: int,
    settings: DoorSettings,
) -> Line:
    """Return the edge of the view that is likeliest near a cell, or a place without one."""
    column = _column(view, probabilities, at)
    reach = settings.network.snap / float(view.s[1] - view.s[0])
    unmarked = Line(column, 1, 0.0, 0.0, float(pieces.step[column]))
    near_by = [line for line in lines if abs(line.column - column) <= reach]

    def weight(line: Line) -> float:
        clarity = line.contrast + settings.network.step * abs(line.step)
        clarity = max(clarity, settings.lines.min_contrast)
        probability = _near(probabilities, round(cell_of(view, line.column)), 1)
        return weight_of(clarity, probability, settings)

    return max([unmarked, *near_by], key=weight)


def weight_of(clarity: float, probability: float, settings: DoorSettings) -> float:
    """Return the weight of a line among those that may be the same edge.

    Parameters
    ----------
    clarity
        Its step of the logarithm of grey, or what counts as much.
    probability
        By the network, which has seen how clear it is, and counts more.
    """
    clarity = min(clarity, settings.lines.equally_clear)
    return float(clarity**2 * probability**settings.network.power)
