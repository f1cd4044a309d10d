"""How far a network expects an edge from where it was read: both its maps must agree."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from kmn_perception.doors.candidates import Candidate
from kmn_perception.doors.plan import OUTWARD, Plan
from kmn_perception.doors.proposals import PanelOrFrame, edge_map
from kmn_perception.doors.settings import DoorSettings
from kmn_perception.doors.view_cells import cell_of

_STEP = 0.01  # metres


def doubt_of(
    candidate: Candidate,
    side: str,
    plan: Plan,
    place: float,
    hinge_place: float,
    settings: DoorSettings,
) -> float:
    """Return the deviation of an edge's place that the network's other opinions make, metres.

    An edge elsewhere is as likely as that its frame and its panel are seen there. What the network
    knows to a cell or two is not counted, nor what is as far as another door.
    """
    if candidate.proposals is None:
        return 0.0
    off = np.arange(-settings.lines.rivals, settings.lines.rivals, _STEP, dtype=np.float64)
    frame = _along(plan.frame_at(place), plan.frame_at(place + 1.0), off)
    panel = _along(
        plan.panel_at(side, place, hinge_place), plan.panel_at(side, place + 1.0, hinge_place), off
    )
    distance = candidate.view.frame.distance
    at = {"frame": frame[:, 0] / frame[:, 1], "panel": panel[:, 0] / panel[:, 1]}
    is_out = OUTWARD[side] * (at["panel"] - at["frame"]) * distance > settings.reveal.line
    is_behind = np.array([plan.behind(point) > 0.0 for point in panel])
    joint = _seen(candidate, side, "frame", at["frame"], is_out & ~is_behind)
    joint = joint * _seen(candidate, side, "panel", at["panel"], is_out & is_behind)
    if not joint.sum() > 0.0:
        return 0.0
    far = np.abs(off) > settings.network.blur
    return float(np.sqrt((joint * off**2)[far].sum() / joint.sum()))


def _along(
    first: NDArray[np.float64], second: NDArray[np.float64], off: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return points (N, 2) of the line through two that are one metre apart along the wall."""
    return first + off[:, None] * (second - first)


def _seen(
    candidate: Candidate,
    side: str,
    of: PanelOrFrame,
    directions: NDArray[np.float64],
    hidden: NDArray[np.bool_],
) -> NDArray[np.float64]:
    """Return how likely an edge is in directions (N,), in some of which the other one hides it."""
    assert candidate.proposals is not None
    view, found = candidate.view, edge_map(candidate.proposals, side, of)
    pixel = float(view.s[1] - view.s[0])
    columns = (directions * view.frame.distance - float(view.s[0])) / pixel
    cells = np.arange(len(found) - 1)
    density = np.interp(cell_of(view, columns), cells, found[:-1], left=0.0, right=0.0)
    return np.where(hidden, np.maximum(density, found[-1]), density)
