"""Candidates that the network proposes, put onto the edges that the view shows."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kmn_perception.doors.candidates import Candidate, distinct, score_of
from kmn_perception.doors.lines import Line, Pieces
from kmn_perception.doors.settings import DoorSettings
from kmn_perception.doors.view_cells import cell_of, cells_of, column_of, height_of
from kmn_perception.doors.wall_view import WallView
from kmn_perception.network.wall_network import KINDS, Proposals, WallNetwork, propose

_LEAST = 1e-6  # probability of what a network finds impossible
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
        [_edge(view, pieces, lines, p, at, settings) for at in _peaks(p, settings.network.peaks)]
        for p in (proposals.left, proposals.right)
    )
    for left in lefts:
        for right in rights:
            width = (right.column - left.column) * pixel
            if narrow - slack <= width <= wide + slack:
                score = score_of(left, right, width, lines, pieces, pixel, settings)
                candidate = Candidate(score, view, pieces, left, right, lines)
                known.append(_judged(candidate, proposals, settings))
    known.sort(key=lambda candidate: -candidate.score)
    return distinct(known, slack / pixel)[: settings.candidates]


def _judged(candidate: Candidate, proposals: Proposals, settings: DoorSettings) -> Candidate:
    view = candidate.view
    left = round(cell_of(view, candidate.left.column))
    right = round(cell_of(view, candidate.right.column))
    confidence = near(proposals.left, left, 1) * near(proposals.right, right, 1)
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
    found = candidate.proposals.left if side == "left" else candidate.proposals.right
    return near(found, round(cell_of(candidate.view, candidate.edge(side).column)))


def near(probabilities: NDArray[np.float32], at: int, reach: int = 2) -> float:
    """Return the probability of the columns about one of them."""
    last = len(probabilities) - 1  # that there is none
    return float(probabilities[max(at - reach, 0) : min(at + reach + 1, last)].sum())


def _peaks(probabilities: NDArray[np.float32], count: int) -> list[int]:
    """Return the columns of the largest peaks."""
    p = probabilities[:-1]
    inner = np.pad(p, 1, constant_values=-1.0)
    peaks = np.flatnonzero((p >= inner[:-2]) & (p > inner[2:]))
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
    column = int(round(float(column_of(view, np.array(float(at))))))
    column = min(max(column, 0), len(view.s) - 1)
    reach = settings.network.snap / float(view.s[1] - view.s[0])
    unmarked = Line(column, 1, 0.0, 0.0, float(pieces.step[column]))
    near_by = [line for line in lines if abs(line.column - column) <= reach]

    def weight(line: Line) -> float:
        clarity = line.contrast + settings.network.step * abs(line.step)
        clarity = max(clarity, settings.lines.min_contrast)
        probability = near(probabilities, round(cell_of(view, line.column)), 1)
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
