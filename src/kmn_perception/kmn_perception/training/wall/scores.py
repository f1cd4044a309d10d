"""How much of held-out views a network gets right."""

from __future__ import annotations

from collections import Counter

import numpy as np

from kmn_perception.network.wall_network import EDGES, ROWS, Proposals
from kmn_perception.training.wall.settings import ScoreSettings
from kmn_perception.training.wall.targets import NO_HANDLE, Target


class Scores:
    """Counts of what was to be found in views, and what was.

    Parameters
    ----------
    cell
        Height and width of the views' cells, metres.
    """

    def __init__(self, settings: ScoreSettings, cell: tuple[float, float]) -> None:
        self._settings, self._cell = settings, cell
        self._right: Counter[str] = Counter()
        self.counts: Counter[str] = Counter()

    def add(self, proposals: Proposals, target: Target) -> None:
        """Judge what is proposed for a view.

        An edge is right if more than half of its probability is near the truth, a missing one if
        more than half says so; of top and handle the likeliest place counts, and of the handle's
        side to which of the true edges that place is nearer.
        """
        high, wide = self._cell
        columns = proposals.edges.shape[1] - 1
        for name, answer in zip(EDGES, proposals.edges, strict=True):
            truth, of = getattr(target, name), "panel_edges" if "panel" in name else "edges"
            if 0.0 <= truth < columns:
                near = np.abs(np.arange(columns) - truth) * wide <= self._settings.edge
                self._count(of, answer[:-1][near].sum() > 0.5)
            else:
                self._count(f"no_{of}", answer[-1] > 0.5)
        edges = np.array([target.left, target.right])
        first, last = np.clip(edges, 0.0, columns - 1.0)
        if last - first > 1.0 and 0.0 <= target.top < ROWS:
            row = int(proposals.top_over(int(first), int(last)).argmax())
            off = abs(row - target.top) * high
            self._count("top", row < ROWS and off <= self._settings.top)
        if not 0.0 <= target.handle_column < columns or not 0.0 <= target.handle_row < ROWS:
            return
        if target.kind != NO_HANDLE:
            cells = proposals.handle.sum(axis=0)
            row, column = map(int, np.unravel_index(int(cells.argmax()), cells.shape))
            off_row, off_column = row - target.handle_row, column - target.handle_column
            off = np.hypot(off_row * high, off_column * wide)
            self._count("handle", off <= self._settings.handle)
            if np.isfinite(edges).all():
                middle = edges.mean()
                self._count("side", (column > middle) == (target.handle_column > middle))

    def shares(self) -> dict[str, float]:
        """Return the shares that are right, of what there was."""
        return {name: round(self._right[name] / n, 4) for name, n in sorted(self.counts.items())}

    def _count(self, what: str, right: bool | np.bool_) -> None:
        self.counts[what] += 1
        self._right[what] += int(right)
