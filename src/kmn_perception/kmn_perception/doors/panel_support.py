"""How much of what is seen between a door's edges is its panel."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from kmn_perception.doors.inverse_depth import Blocks
from kmn_perception.doors.seen_blocks import PANEL, PANEL_HIGH, SeenBlocks
from kmn_perception.doors.settings import FitSettings
from kmn_perception.doors.surfaces import Surfaces
from kmn_perception.doors.wall_view import WallFrame


class PanelSupport(NamedTuple):
    """What speaks for a panel.

    Attributes
    ----------
    share
        Share of the blocks between the edges, but for hidden ones, that lie on the panel; those
        that were not measured do not.
    visible
        Share of all blocks between the edges that are measured and unhidden.
    """

    share: float
    visible: float


def support_panel(
    blocks: Blocks,
    frame: WallFrame,
    surfaces: Surfaces,
    edges: tuple[float, float],
    top: float | None,
    settings: FitSettings,
) -> PanelSupport:
    """Return what speaks for the panel of a fit.

    Parameters
    ----------
    edges
        Directions, metres to the right per metre away, between which it is seen.
    top
        Height above the floor at which the wall's view shows its top, metres; None if it does not.
    """
    seen = SeenBlocks.of(blocks, frame)
    high = PANEL_HIGH if top is None else min(PANEL_HIGH, top - settings.margin)
    inside = seen.between(edges, settings.margin, high)
    unhidden = seen.valid & inside & (seen.offset < settings.reach)
    hidden = seen.valid & inside & (seen.offset >= settings.reach)
    between = seen.part(PANEL, unhidden, settings.block_noise)
    off = np.abs(between.derivatives(surfaces.values) @ surfaces.values - between.inverse)
    on_panel = int((off < settings.inlier * settings.pixel_noise).sum())
    return PanelSupport(
        share=on_panel / max(1, int((inside & ~hidden).sum())),
        visible=float(unhidden.sum() / max(1, inside.sum())),
    )
