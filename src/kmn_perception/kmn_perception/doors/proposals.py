"""Candidates that the network proposes, put onto the edges that the view shows."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from kmn_perception.doors.candidates import Candidate, score_of
from kmn_perception.doors.lines import Line, Pieces
from kmn_perception.doors.settings import DoorSettings
from kmn_perception.doors.view_cells import cell_of, cells_of, column_of
from kmn_perception.doors.wall_view import WallView
from kmn_perception.network.wall_network import Proposals, WallNetwork, propose


def propose_candidates(
    view: WallView,
    pieces: Pieces,
    lines: Sequence[Line],
    network: WallNetwork,
    settings: DoorSettings,
) -> list[Candidate]:
    """Return the pairs of edges that the network finds likely, the likeliest first."""
    noise = settings.fit.pixel_noise
    proposals = propose(network, cells_of(view, noise, settings.view.before * noise))
    pixel = float(view.s[1] - view.s[0])
    narrow, wide = settings.verdict.width
    slack = settings.lines.tie
    found: list[Candidate] = []
    for first in _peaks(proposals.left, settings.network.peaks):
        for last in _peaks(proposals.right, settings.network.peaks):
            edges = [_edge(view, pieces, lines, at, settings) for at in (first, last)]
            width = (edges[1].column - edges[0].column) * pixel
            if not narrow - slack <= width <= wide + slack:
                continue
            confidence = near(proposals.left, first) * near(proposals.right, last)
            if confidence < settings.network.min_confidence:
                continue
            score = score_of(edges[0], edges[1], width, lines, pieces, pixel, settings)
            score += settings.score.network * (1.0 + np.log10(confidence) / 3.0)
            found.append(
                Candidate(score, view, pieces, edges[0], edges[1], confidence, proposals)
            )
    found.sort(key=lambda candidate: -candidate.score)
    return found


def confidence_of(candidate: Candidate, proposals: Proposals) -> float:
    """Return the network's probability of a candidate's edges."""
    view = candidate.view
    left = cell_of(view, candidate.left.column)
    right = cell_of(view, candidate.right.column)
    return near(proposals.left, round(left)) * near(proposals.right, round(right))


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
    view: WallView, pieces: Pieces, lines: Sequence[Line], at: int, settings: DoorSettings
) -> Line:
    """Return the clearest edge of the view near a cell, or a place without one."""
    column = int(round(float(column_of(view, np.array(float(at))))))
    reach = settings.network.snap / float(view.s[1] - view.s[0])
    close = [line for line in lines if abs(line.column - column) <= reach]
    if close:
        return max(close, key=lambda line: min(line.contrast, 1.0) + 0.05 * abs(line.step))
    column = min(max(column, 0), len(view.s) - 1)
    return Line(column, 1, 0.0, 0.0, float(pieces.step[column]))
