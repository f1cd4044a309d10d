"""One candidate measured: its surfaces, edges, top and handle, and the door that follows."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kmn_perception.doors.candidates import Candidate
from kmn_perception.doors.edges import measure_edge
from kmn_perception.doors.geometry import (
    DOOR,
    EDGES,
    HANDLE_INSET,
    MEASURED,
    PROUD,
    DoorShape,
    View2d,
    door_shape,
    door_values,
    propagate,
)
from kmn_perception.doors.handle import Handle, Hint, find_handle
from kmn_perception.doors.inverse_depth import Blocks
from kmn_perception.doors.layout import OPPOSITE, SIDES, lay_out, read_at
from kmn_perception.doors.lintel import Lintel, find_lintel, usual_top
from kmn_perception.doors.panel_support import PanelSupport, support_panel
from kmn_perception.doors.proposals import handle_of
from kmn_perception.doors.readings import EdgeReading
from kmn_perception.doors.seen_blocks import FLOOR, PANEL, WALL
from kmn_perception.doors.settings import DoorSettings
from kmn_perception.doors.surfaces import Surfaces
from kmn_perception.doors.upright import HeightSource
from kmn_perception.doors.wall_view import WallFrame
from kmn_perception.doors.walls import Frame


class Measurement(NamedTuple):
    """A candidate with all that was measured of it.

    Attributes
    ----------
    shape, values, covariance
        The door, see `door_shape` and `DOOR`.
    inverse_height
        Of the camera above the floor, 1/m.
    edge_deviations
        Of the left and right edge, metres, as the image tells them: other lines that may be it, and
        whether it is the frame's or the panel's, but not the error of the panel's plane.
    handle
        None where it is not seen.
    latch, hinge_is_known
        ``left`` or ``right``, at which the parameters take the latch to be, and whether an open
        panel, or a handle, tell it.
    """

    candidate: Candidate
    surfaces: Surfaces
    support: PanelSupport
    lintel: Lintel
    handle: Handle | None
    latch: str
    hinge_is_known: bool
    shape: DoorShape
    values: NDArray[np.float64]
    covariance: NDArray[np.float64]
    inverse_height: float
    edge_deviations: tuple[float, float]


def measure(
    frame: Frame, blocks: Blocks, candidate: Candidate, height: HeightSource, settings: DoorSettings
) -> Measurement | None:
    """Measure a candidate; None where wall or panel are hardly seen."""
    at = candidate.view.frame
    layout = lay_out(blocks, candidate, height, settings)
    if layout is None:
        return None
    surfaces, hinges, edges = layout
    spans = edges["left"].panel_from("left"), edges["right"].panel_from("right")
    candidate = candidate._replace(left=edges["left"].line, right=edges["right"].line)
    panel = WallFrame.of(_vector(at, surfaces.values[PANEL]), at.up, 1.0 / surfaces.values[FLOOR])
    left, right = (_along(at, panel, surfaces, edges[side].panel) for side in SIDES)
    if not (
        right - left > settings.lines.tie
        and max(-left, right) < settings.view.reach
        and panel.distance > settings.lines.tie
    ):
        return None  # so oblique a panel shows nothing
    lintel = find_lintel(candidate, _lintel_heights(candidate, surfaces, settings), settings.lintel)
    sides = tuple(OPPOSITE[hinge] for hinge in hinges) or SIDES
    handle = find_handle(
        panel, (left, right), sides, frame.depth, frame.grey, frame.camera,
        settings.handle, settings.lines.step_noise, _hint(candidate, panel),
    )  # fmt: skip
    look = View2d(at.right[2], -at.normal[2])
    ajar = bool(hinges)
    for found in (handle, None):
        latch, edges = _latch(found, hinges), layout.edges
        if latch in hinges[:1]:  # the handle tells of two possible hinges which it is
            edges = read_at(OPPOSITE[latch], candidate, surfaces, settings) or edges
        measured, covariance = _gather(
            candidate, panel, surfaces, edges, lintel, found, height, settings
        )
        values_of = partial(door_values, hinge_right=latch == "left", ajar=ajar, look=look)
        values, spread = propagate(values_of, measured, covariance)
        handle = found
        if found is None or _is_on_panel(values, spread, settings):
            break  # else nothing that this handle told may remain
    return Measurement(
        candidate,
        surfaces,
        support_panel(blocks, at, surfaces, spans, lintel.z, settings.fit),
        lintel,
        handle,
        latch,
        handle is not None or len(hinges) == 1,
        door_shape(measured, latch == "left", ajar),
        values,
        spread,
        float(measured[4]),
        _edge_deviations(measured, covariance, latch == "left", ajar),
    )


def _latch(handle: Handle | None, hinges: tuple[str, ...]) -> str:
    """Return the side of the latch; at the right of a closed door that does not show it."""
    if handle is not None:
        return handle.side
    return OPPOSITE[hinges[0]] if hinges else "right"


def _edge_deviations(
    measured: NDArray[np.float64], covariance: NDArray[np.float64], hinge_right: bool, ajar: bool
) -> tuple[float, float]:
    """Return how well it is known which lines are the panel's edges, wherever its plane is."""
    own = np.zeros_like(covariance)
    own[EDGES, EDGES] = covariance[EDGES, EDGES]
    own[PROUD, PROUD] = covariance[PROUD, PROUD]

    def corners(m: NDArray[np.float64]) -> NDArray[np.float64]:
        shape = door_shape(m, hinge_right, ajar)
        return np.concatenate([shape.left, shape.right], axis=-1)

    variances = np.diag(propagate(corners, measured, own)[1])
    return float(np.sqrt(variances[:2].sum())), float(np.sqrt(variances[2:].sum()))


def _is_on_panel(
    values: NDArray[np.float64], covariance: NDArray[np.float64], settings: DoorSettings
) -> bool:
    """Return whether a handle is as far from the edge as handles are, within its deviation."""
    i = DOOR.index("handle_y")
    low, high = settings.handle.inset
    inset, slack = HANDLE_INSET + values[i], min(2.0 * np.sqrt(covariance[i, i]), low)
    return bool(low - slack <= inset <= high + slack)


def _hint(candidate: Candidate, panel: WallFrame) -> Hint | None:
    """Return where on the panel a network sees a handle."""
    seen = handle_of(candidate)
    if seen is None:
        return None
    at = candidate.view.frame
    ray = at.points(np.array(seen.s), np.array(seen.z))
    point = ray * (-panel.distance / float(ray @ panel.normal))
    z = float(point @ panel.up) + panel.height
    return Hint(seen.kind, seen.lever_odds, float(point @ panel.right), z, seen.probability)


def _lintel_heights(
    candidate: Candidate, surfaces: Surfaces, settings: DoorSettings
) -> tuple[float, float]:
    """Return where tops may be in the view, whose scale the fit may have corrected."""
    at = candidate.view.frame
    middle = np.array([0.5 * sum(candidate.directions), 1.0])
    scale = at.distance * float(surfaces.values[WALL] @ middle)
    floor = 1.0 / surfaces.values[FLOOR]
    low, high = ((z - floor) * scale + at.height for z in settings.lintel.heights)
    return low, high


def _vector(frame: WallFrame, line: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the plane's vector of a line seen from above."""
    vector: NDArray[np.float64] = line[0] * frame.right - line[1] * frame.normal
    return vector


def _along(at: WallFrame, panel: WallFrame, surfaces: Surfaces, direction: float) -> float:
    """Return where a direction meets the panel, metres to the right along it."""
    ray = np.array([direction, 1.0])
    point = ray / (surfaces.values[PANEL] @ ray)
    return float(point[0] * (at.right @ panel.right) - point[1] * (at.normal @ panel.right))


def _gather(
    candidate: Candidate,
    panel: WallFrame,
    surfaces: Surfaces,
    edges: Mapping[str, EdgeReading],
    lintel: Lintel,
    handle: Handle | None,
    source: HeightSource,
    settings: DoorSettings,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return what was measured (14,) and its covariance, see `MEASURED`."""
    at, count = candidate.view.frame, len(MEASURED)
    wall_line, panel_line = surfaces.values[WALL], surfaces.values[PANEL]
    values, deviations = np.zeros(count), np.zeros(count)
    values[:5] = surfaces.values[:5]
    values[PROUD], deviations[PROUD] = settings.reveal.proud
    for i, side in enumerate(SIDES):
        edge = edges[side]
        direction, deviation = measure_edge(candidate, edge.line, settings)
        values[5 + i] = direction
        deviations[5 + i] = np.hypot(deviation, edge.spread / at.distance)
        values[7 + i], deviations[7 + i] = edge.on_panel, edge.doubt
    expected = settings.prior.handle_height
    height = 1.0 / surfaces.values[FLOOR]
    if handle is None:
        # Where to look: at the usual place of the right edge.
        left, right = values[5:7]
        far = 1.0 / float(panel_line @ np.array([right, 1.0]))
        values[10] = right - settings.prior.handle_inset[0] / far
        deviations[10] = right - left
        values[11], deviations[11] = (expected[0] - height) / far, 3.0 * expected[1] / far
    else:
        point = panel.points(np.array(handle.s), np.array(handle.z))
        away = float(-point @ at.normal)
        values[10], values[11] = float(point @ at.right) / away, float(point @ at.up) / away
        deviations[10], deviations[11] = handle.along_noise / away, handle.up_noise / away
    values[12], deviations[12] = settings.handle.protrusion
    covariance = np.zeros((count, count))
    covariance[:5, :5] = surfaces.covariance[:5, :5]
    over = np.array([0.5 * (values[5] + values[6]), 1.0])
    far = 1.0 / float(wall_line @ over)
    rise = None if lintel.z is None else (lintel.z - at.height) / at.distance
    if source is HeightSource.USUAL:
        # The usual height of handle or top tells the floor's, and no more than that.
        height, slack = settings.prior.camera_height
        if handle is not None:
            away = 1.0 / float(panel_line @ np.array([values[10], 1.0]))
            height, slack = expected[0] - values[11] * away, expected[1]
        elif rise is not None:
            height, slack = settings.prior.height[0] - rise * far, settings.prior.height[1]
        values[4] = 1.0 / height
        covariance[4, :] = covariance[:, 4] = 0.0
        covariance[4, 4] = (slack / height**2) ** 2
    if rise is None:
        top, deviation = usual_top(lintel.seen_to, settings.prior.height, settings.lintel.missed)
        values[9], deviations[9] = (top - height) / far, deviation / far
    else:
        # Is it the frame's or, of a panel elsewhere, the panel's own?
        apart = rise * (far - 1.0 / float(panel_line @ over)) / far
        values[9] = rise
        deviations[9] = np.hypot(lintel.deviation / at.distance, apart)
    covariance += np.diag(deviations**2)
    return values, covariance
