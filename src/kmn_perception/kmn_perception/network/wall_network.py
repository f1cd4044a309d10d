"""The network that proposes doors in the view of a wall: edges, top and handle."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.nn import functional

CHANNELS, ROWS = 7, 64  # of a view's cells
KINDS = ("lever", "knob", "bar")
EDGES = ("left", "right", "panel_left", "panel_right")  # of the frame, and of the panel in it
_FEATURES = (24, 32, 48)  # of columns, ever coarser upwards
_DILATIONS = 2 * (1, 2, 4, 8, 16, 24)
_CONTEXT, _JOINED, _GROUPS = 16, 24, 4
_NO_HANDLE = 3.0  # where the logit of no handle starts


class Logits(NamedTuple):
    """What the network says of views of N columns.

    Attributes
    ----------
    edges
        (B, 4, N) upright edges by column, see ``EDGES``.
    none
        (B, 5) that none is seen of each of these, and no handle.
    top
        (B, ROWS, N) the door's top by row, for doors over each column.
    handle
        (B, 3, ROWS, N) the handle's middle by kind and cell.
    """

    edges: Tensor
    none: Tensor
    top: Tensor
    handle: Tensor


class WallNetwork(nn.Module):
    """Columns of a wall are read by convolutions, then along the wall by dilated ones."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.width = width
        a, b, c = _FEATURES
        self.columns = nn.Sequential(
            nn.Conv2d(CHANNELS + 2, a, 3, stride=(2, 1), padding=1),
            nn.GroupNorm(_GROUPS, a),
            nn.ReLU(),
            nn.Conv2d(a, b, 3, stride=(2, 1), padding=1),
            nn.GroupNorm(_GROUPS, b),
            nn.ReLU(),
            nn.Conv2d(b, c, 3, padding=1),
            nn.GroupNorm(_GROUPS, c),
            nn.ReLU(),
        )
        self.column = nn.Conv1d(c * ROWS // 4, width, 1)
        self.along = nn.ModuleList(
            nn.Sequential(
                nn.GroupNorm(1, width),
                nn.Conv1d(width, width, 5, padding=2 * d, dilation=d, groups=_GROUPS),
                nn.ReLU(),
                nn.Conv1d(width, width, 1),
            )
            for d in _DILATIONS
        )
        self.edges = nn.Conv1d(width, len(EDGES), 5, padding=2)
        self.none = nn.Linear(width, len(EDGES) + 1)
        self.context = nn.Conv1d(width, _CONTEXT, 1)
        self.joined = nn.Conv2d(c + _CONTEXT, _JOINED, 3, padding=1)
        self.top = nn.Conv2d(_JOINED, 4, 1)
        self.handle = nn.Conv2d(_JOINED, 4 * len(KINDS), 3, padding=1)

    def forward(self, cells: Tensor) -> Logits:
        """Read cells (B, CHANNELS, ROWS, N)."""
        count, _, rows, columns = cells.shape
        z = torch.linspace(-1.0, 1.0, rows, device=cells.device)
        z = z.view(1, 1, rows, 1).expand(count, 1, rows, columns)
        x = self.columns(torch.cat([cells, z, z * z], dim=1))
        y = functional.relu(self.column(x.reshape(count, -1, columns)))
        for along in self.along:
            y = y + along(y)
        y = functional.relu(y)
        start = torch.tensor([0.0] * len(EDGES) + [_NO_HANDLE], device=y.device)
        none = self.none(y.amax(dim=2)) + start
        context = self.context(y)[:, :, None].expand(count, _CONTEXT, rows // 4, columns)
        joined = functional.relu(self.joined(torch.cat([x, context], dim=1)))
        return Logits(
            edges=self.edges(y),
            none=none,
            top=_finer(self.top(joined), 1)[:, 0],
            handle=_finer(self.handle(joined), len(KINDS)),
        )


class Proposals(NamedTuple):
    """What the network proposes for one view of N columns of cells.

    Attributes
    ----------
    edges
        (4, N + 1) probabilities of the edges by column, see ``EDGES``; the last one: none is seen.
    top
        (ROWS, N) logits of the top by row, see `top_over`.
    handle
        (3, ROWS, N) probabilities of the handle by kind and cell.
    """

    edges: NDArray[np.float32]
    top: NDArray[np.float32]
    handle: NDArray[np.float32]

    def between(self, first: int, last: int) -> Proposals:
        """Return what is proposed for the columns of cells first to last - 1."""
        edges = np.concatenate([self.edges[:, first:last], self.edges[:, -1:]], axis=1)
        return Proposals(edges, self.top[:, first:last], self.handle[..., first:last])

    def top_over(self, first: int, last: int) -> NDArray[np.float64]:
        """Return probabilities (ROWS + 1,) of the top of a door over columns; the last: unseen."""
        logits = np.append(self.top[:, first : last + 1].mean(axis=1, dtype=np.float64), 0.0)
        weights = np.exp(logits - logits.max())
        return weights / weights.sum()


def propose(network: WallNetwork, cells: NDArray[np.float32]) -> Proposals:
    """Return what a network proposes for the cells (CHANNELS, ROWS, N) of one view."""
    with torch.inference_mode():
        return proposals_of(network(torch.from_numpy(cells)[None]))


def proposals_of(logits: Logits) -> Proposals:
    """Return what the logits of one view (B = 1) propose."""
    edges = torch.cat([logits.edges, logits.none[:, :-1, None]], dim=2).softmax(dim=2)[0]
    handle = torch.cat([logits.handle.reshape(1, -1), logits.none[:, -1:]], dim=1)
    handle = handle.softmax(dim=1)[0, :-1].reshape(logits.handle.shape[1:])
    return Proposals(edges.numpy(), logits.top[0].numpy(), handle.numpy())


def _finer(values: Tensor, kinds: int) -> Tensor:
    """Return values (B, kinds, 4 R, N) of four channels (B, 4 kinds, R, N) each."""
    count, _, rows, columns = values.shape
    parts = values.view(count, kinds, 4, rows, columns).permute(0, 1, 3, 2, 4)
    return parts.reshape(count, kinds, 4 * rows, columns)
