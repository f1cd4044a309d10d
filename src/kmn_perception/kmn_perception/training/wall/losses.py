"""The loss: cross entropies to soft targets, of which one says that there is nothing."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from kmn_perception.network.wall_network import EDGES, KINDS, ROWS, Logits
from kmn_perception.training.wall.settings import LossWeights, Spread
from kmn_perception.training.wall.targets import NO_HANDLE, Target

_MIN_COLUMNS = 10  # of a door over which its top can be told


class SoftTargets(NamedTuple):
    """What the network shall answer for views of N columns; weights are 0 or 1.

    Attributes
    ----------
    edges
        (B, 4, N + 1) of the upright edges; the last column: none is seen.
    top, over, top_known
        (B, ROWS + 1), of which the last one: not seen; (B, N) mean over the door's columns; and
        (B,) weights.
    handle, handle_known
        (B, 3 ROWS N + 1), of which the last one: there is none; and (B,) weights.
    """

    edges: Tensor
    top: Tensor
    over: Tensor
    top_known: Tensor
    handle: Tensor
    handle_known: Tensor


class Losses(NamedTuple):
    """Parts of the loss, means over what is known."""

    edges: Tensor
    top: Tensor
    handle: Tensor

    def total(self, weights: LossWeights) -> Tensor:
        """Return their weighted sum."""
        return weights.edges * self.edges + weights.top * self.top + weights.handle * self.handle


def soft_targets(targets: Sequence[Target], columns: int, spread: Spread) -> SoftTargets:
    """Return what shall be answered for views of so many columns."""
    count = len(targets)
    soft = SoftTargets(
        edges=torch.zeros(count, len(EDGES), columns + 1),
        top=torch.zeros(count, ROWS + 1),
        over=torch.zeros(count, columns),
        top_known=torch.zeros(count),
        handle=torch.zeros(count, len(KINDS) * ROWS * columns + 1),
        handle_known=torch.ones(count),
    )
    for i, target in enumerate(targets):
        for k, name in enumerate(EDGES):
            soft.edges[i, k] = _line(getattr(target, name), columns, spread.edge)
        if np.isfinite(target.left + target.right):
            first, last = max(int(target.left), 0), min(int(target.right), columns - 1)
            if last - first > _MIN_COLUMNS:
                soft.over[i, first:last] = 1.0 / (last - first)
                soft.top[i] = _line(target.top, ROWS, spread.top)
                soft.top_known[i] = 1.0
        soft.handle[i], soft.handle_known[i] = _handle(target, columns, spread)
    return soft


def losses(logits: Logits, soft: SoftTargets) -> Losses:
    """Return the losses of what a network says."""
    edges = torch.cat([logits.edges, logits.none[:, :-1, None]], dim=2)
    top = (logits.top * soft.over[:, None]).sum(dim=2)
    top = torch.cat([top, torch.zeros_like(top[:, :1])], dim=1)
    handle = torch.cat([logits.handle.flatten(1), logits.none[:, -1:]], dim=1)
    return Losses(
        edges=_cross_entropy(edges, soft.edges).mean(),
        top=_mean(_cross_entropy(top, soft.top), soft.top_known),
        handle=_mean(_cross_entropy(handle, soft.handle), soft.handle_known),
    )


def _handle(target: Target, columns: int, spread: Spread) -> tuple[Tensor, float]:
    """Return where the handle is, by kind and cell, and whether that is known."""
    answer = torch.zeros(len(KINDS) * ROWS * columns + 1)
    if not target.door or target.kind == NO_HANDLE:
        answer[-1] = 1.0
        return answer, 1.0
    place = _line(target.handle_row, ROWS, spread.handle[0])[:-1, None]
    place = place * _line(target.handle_column, columns, spread.handle[1])[:-1]
    if not place.any():  # a handle beside the window is neither here nor missing
        return answer, 0.0
    first = int(target.kind) * ROWS * columns
    answer[first : first + ROWS * columns] = place.flatten()
    return answer, 1.0


def _line(at: float, count: int, deviation: float) -> Tensor:
    """Return a Gaussian about a cell of a line of ``count``, or the last one if it is not there."""
    answer: NDArray[np.float64] = np.zeros(count + 1)
    if 0.0 <= at < count:
        near = np.exp(-0.5 * ((np.arange(count) - at) / deviation) ** 2)
        answer[:-1] = near / near.sum()
    else:  # or not known
        answer[-1] = 1.0
    return torch.from_numpy(answer.astype(np.float32))


def _cross_entropy(logits: Tensor, answers: Tensor) -> Tensor:
    return -(answers * logits.log_softmax(dim=-1)).sum(dim=-1)


def _mean(values: Tensor, weights: Tensor) -> Tensor:
    return (values * weights).sum() / weights.sum().clamp(min=1.0)
