"""Pairs of upright edges that may be a door's, and what speaks for them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from kmn_perception.doors.lines import Line, Pieces
from kmn_perception.doors.settings import DoorSettings
from kmn_perception.doors.wall_view import WallView
from kmn_perception.network.wall_network import Proposals


class Candidate(NamedTuple):
    """Two edges of a view.

    Attributes
    ----------
    score
        The larger, the more it looks like a door.
    lines
        All upright edges of the view.
    confidence, proposals
        The network's probability of these edges, and what else it proposes; NaN and None without a
        network.
    """

    score: float
    view: WallView
    pieces: Pieces
    left: Line
    right: Line
    lines: Sequence[Line]
    confidence: float = np.nan
    proposals: Proposals | None = None

    def edge(self, side: str) -> Line:
        """Return the ``left`` or the ``right`` edge."""
        return self.left if side == "left" else self.right

    @property
    def directions(self) -> tuple[float, float]:
        """Of left and right edge: metres to the right over the view's distance."""
        s, distance = self.view.s, self.view.frame.distance
        return s[self.left.column] / distance, s[self.right.column] / distance


def find_candidates(
    view: WallView, pieces: Pieces, lines: Sequence[Line], settings: DoorSettings
) -> list[Candidate]:
    """Return the pairs of edges that are as far apart as a door's, the best first."""
    pixel = float(view.s[1] - view.s[0])
    narrow, wide = settings.verdict.width
    slack = settings.lines.tie
    found = []
    for i, left in enumerate(lines):
        for right in lines[i + 1 :]:
            width = (right.column - left.column) * pixel
            if narrow - slack <= width <= wide + slack:
                score = score_of(left, right, width, lines, pieces, pixel, settings)
                found.append(Candidate(score, view, pieces, left, right, lines))
    found.sort(key=lambda candidate: -candidate.score)
    return distinct(found, slack / pixel)[: settings.candidates]


def distinct(candidates: Sequence[Candidate], tie: float) -> list[Candidate]:
    """Keep, of pairs whose edges lie within so many pixels, the one with the clearest edges."""
    kept: list[Candidate] = []
    for candidate in candidates:
        for i, other in enumerate(kept):
            if (
                abs(candidate.left.column - other.left.column) <= tie
                and abs(candidate.right.column - other.right.column) <= tie
            ):
                if _clarity(candidate) > _clarity(other):
                    kept[i] = candidate._replace(score=max(candidate.score, other.score))
                break
        else:
            kept.append(candidate)
    return kept


def _clarity(candidate: Candidate) -> float:
    if candidate.proposals is not None:
        return candidate.score
    opposite = candidate.left.sign == -candidate.right.sign
    lines = (candidate.left, candidate.right)
    return sum(min(line.contrast, 1.0) + 0.05 * abs(line.step) for line in lines) * (1 + opposite)


def score_of(
    left: Line,
    right: Line,
    width: float,
    lines: Sequence[Line],
    pieces: Pieces,
    pixel: float,
    settings: DoorSettings,
) -> float:
    """Return the weighed sum of what is seen of a pair."""
    weight = settings.score
    first, last = left.column, right.column
    reach = settings.lines.tie / pixel
    weaker = max(min(left.contrast, right.contrast), settings.lines.min_contrast)
    inner = max(
        (
            line.coverage * min(line.contrast / weaker, 1.5)
            for line in lines
            if first + reach < line.column < last - reach
        ),
        default=0.0,
    )
    edge = round(0.3 * reach)
    hidden, hollow = pieces.shares_between(first + edge, last - edge)
    contrast = sum(min(line.contrast, weight.max_contrast) for line in (left, right))
    # A recess: nearer outside, at both edges.
    step = min(max(min(left.step, -right.step) / settings.lines.min_step, 0.0), 2.0)
    return (
        left.coverage
        + right.coverage
        + weight.opposite * (left.sign == -right.sign)
        + weight.contrast * contrast
        + weight.step * step
        - weight.inner_line * inner
        - weight.hollow * hollow
        - weight.hidden * hidden
        - weight.width * abs(width - weight.expected_width)
    )
