"""One fit of wall, panel, floor and calibration to the inverse depths about a pair of edges.

Seen from above, with x to the right and y away from the camera, a vertical plane is the line
b x + c y = 1, and a ray (x, y, up) sees the inverse depth b x + c y there. The floor at a height h
below gives -up / h. A sensor whose calibration is off adds an offset to all of them, and a warp
over the image; they show where the floor or a tilted view ties depths to the vertical, and where
wall and panel should be parallel. All of this is linear.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kmn_perception.doors.inverse_depth import Blocks
from kmn_perception.doors.normal_equations import add_blocks
from kmn_perception.doors.seen_blocks import (
    FLOOR,
    FLOOR_OFFSET,
    LOW,
    PANEL,
    PANEL_HIGH,
    SIZE,
    TILT,
    WALL,
    WARP,
    PartSeen,
    SeenBlocks,
)  # fmt: skip
from kmn_perception.doors.settings import Calibration, FitSettings
from kmn_perception.doors.upright import HeightSource
from kmn_perception.doors.wall_view import WallFrame

_TRIALS, _ROUNDS = 150, 5
_HIGH = 2.4  # metres above the floor up to which the wall is taken
_MAX_TURN = 0.6  # radians to the plane that was found
_MIN_AREA = 0.02  # of two rays seen from above; nearer ones tell no line
_CHECKED = 400  # blocks on which lines are compared, about
_FIRM = 1e6  # information that holds a value where it is


class Surfaces(NamedTuple):
    """What the fit says.

    Attributes
    ----------
    values
        (12,) wall (b, c), panel (b, c), 1 / height of the camera, tilts of the vertical to the
        right and away (radians), offset of the inverse depths (1/m), and its warp: per metre to the
        right and down in the image at a depth of 1 m, and per square of the former; and a floor's
        own offset, since it shines.
    covariance
        (12, 12) of these.
    wall_blocks, panel_blocks
        How many blocks lie on them.
    wall_share
        Share of the unhidden measured blocks beside the edges that lie on the wall.
    opening
        Angle of the panel to the wall, radians, positive to the right; 0 if it counts as closed.
    """

    values: NDArray[np.float64]
    covariance: NDArray[np.float64]
    wall_blocks: int
    panel_blocks: int
    wall_share: float
    opening: float


def fit_surfaces(
    blocks: Blocks,
    frame: WallFrame,
    edges: tuple[float, float],
    outer: tuple[float, float],
    height: HeightSource,
    calibration: Calibration,
    settings: FitSettings,
) -> Surfaces | None:
    """Fit wall, panel and floor about two edges; None where wall or panel are hardly measured.

    Parameters
    ----------
    edges, outer
        Directions, metres to the right per metre away, between which the panel is seen, and beyond
        which its frame or the wall is.
    height
        How the frame's height above the floor is known.
    calibration
        Of the sensor.
    """
    seen = SeenBlocks.of(blocks, frame)
    frame_left, frame_right = (edge * frame.distance for edge in outer)
    level = (seen.z > LOW) & (seen.z < _HIGH)
    beyond = np.maximum(frame_left - seen.side, seen.side - frame_right) - settings.frame
    beside = (beyond > 0.0) & (beyond < settings.beside)
    near = seen.valid & (seen.offset < settings.reach)
    behind = seen.offset_at(settings.behind)
    noise = settings.block_noise * settings.correlation / blocks.size
    wall_seen = seen.part(WALL, near & level & beside & (seen.offset > -settings.reach), noise)
    inside = seen.between(edges, settings.margin, PANEL_HIGH)
    deepest = np.minimum(-settings.reach, behind)
    panel_seen = seen.part(PANEL, near & inside & (seen.offset > deepest), noise)
    wall, panel = (_start(surface, settings) for surface in (wall_seen, panel_seen))
    if wall is None or panel is None:
        return None
    surfaces = [wall_seen, panel_seen]
    if height is not HeightSource.USUAL:
        before = seen.offset > 2.0 * settings.inlier * settings.pixel_noise  # no foot of a wall
        below = seen.valid & (seen.axes[:, 2] < 0.0)
        shining = settings.floor_noise * settings.correlation / blocks.size
        surfaces.append(seen.part(FLOOR, below & before, shining))
    start = np.concatenate((wall, panel, [1.0 / frame.height], np.zeros(SIZE - 5)))
    believed = _believed(start, height, calibration, settings)
    values, covariance, counts = _solve(surfaces, start, believed, None, settings)
    if min(counts[:2]) < settings.min_blocks:
        return None
    turn, deviation = _turn(values, covariance, settings)
    least, deviations = settings.ajar
    opening = turn if abs(turn) > max(least, deviations * deviation) else 0.0
    if abs(turn) < settings.agree * deviation:
        values, covariance, counts = _solve(surfaces, values, believed, settings.closed, settings)
    around = int((near & level & beside).sum())
    return Surfaces(
        values=values,
        covariance=covariance,
        wall_blocks=counts[0],
        panel_blocks=counts[1],
        wall_share=counts[0] / max(1, around),
        opening=opening,
    )


def _believed(
    start: NDArray[np.float64],
    height: HeightSource,
    calibration: Calibration,
    settings: FitSettings,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return what is known before the fit: the information (12, 12), and the values (12,)."""
    slope = calibration.slope
    deviations = np.full(SIZE, np.inf)
    deviations[TILT] = settings.tilt
    deviations[WARP] = calibration.offset, slope, slope, calibration.bend
    deviations[FLOOR_OFFSET] = calibration.floor
    if height is not HeightSource.USUAL:
        given = height is HeightSource.GIVEN
        deviation = settings.given_height if given else settings.seen_height
        deviations[FLOOR] = deviation * start[FLOOR] ** 2
    expected = np.zeros(SIZE)
    expected[FLOOR] = start[FLOOR]
    return np.diag(deviations**-2.0), expected


def angle(line: NDArray[np.float64]) -> float:
    """Return the turn of a line (b, c) to the right, radians."""
    return float(np.arctan2(line[0], line[1]))


def _turn(
    values: NDArray[np.float64], covariance: NDArray[np.float64], settings: FitSettings
) -> tuple[float, float]:
    """Return the panel's angle to the wall and its standard deviation, radians."""
    row = _turn_row(values)
    deviation = float(np.hypot(np.sqrt(row @ covariance @ row), settings.closed))
    return angle(values[PANEL]) - angle(values[WALL]), deviation


def _turn_row(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the derivatives (12,) of the panel's angle to the wall."""
    row = np.zeros(SIZE)
    for part, sign in ((PANEL, 1.0), (WALL, -1.0)):
        b, c = values[part]
        row[part] = sign * np.array([c, -b]) / (b * b + c * c)
    return row


def _start(seen: PartSeen, settings: FitSettings) -> NDArray[np.float64] | None:
    """Return the line (b, c) that most blocks lie on."""
    count = len(seen.inverse)
    if count < settings.min_blocks:
        return None
    pairs = np.random.default_rng(0).integers(count, size=(_TRIALS, 2))
    rays, inverse = seen.rays[:, :2], seen.inverse
    first, second = rays[pairs[:, 0]], rays[pairs[:, 1]]
    area = first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]
    apart = np.abs(area) > _MIN_AREA
    first, second, area = first[apart], second[apart], area[apart]
    w1, w2 = inverse[pairs[apart]].T
    lines = np.stack([w1 * second[:, 1] - w2 * first[:, 1], w2 * first[:, 0] - w1 * second[:, 0]])
    lines /= area
    lines = lines[:, (lines[1] > 0.0) & (np.abs(np.arctan2(*lines)) < _MAX_TURN)]
    if not lines.size:
        return None
    few = slice(None, None, max(1, count // _CHECKED))
    off = np.abs(rays[few] @ lines - inverse[few, None])
    near = off < settings.inlier * settings.pixel_noise
    best: NDArray[np.float64] = lines[:, near.sum(axis=0).argmax()]
    return best


def _solve(
    surfaces: Sequence[PartSeen],
    start: NDArray[np.float64],
    believed: tuple[NDArray[np.float64], NDArray[np.float64]],
    closed: float | None,
    settings: FitSettings,
) -> tuple[NDArray[np.float64], NDArray[np.float64], list[int]]:
    """Return values, covariance, and how many blocks lie on each surface.

    Parameters
    ----------
    believed
        Information (12, 12) of what is known before, and the values (12,) that it is about.
    """
    values = start.copy()
    reach = settings.inlier * settings.pixel_noise
    prior, expected = believed
    counts: list[int] = []
    for _ in range(_ROUNDS):
        information, right_side, counts = prior.copy(), prior @ expected, []
        for surface in surfaces:
            rows, inverse = surface.derivatives(values), surface.inverse
            equations = information, right_side
            counts.append(add_blocks(*equations, rows, inverse, values, reach, surface.noise))
        if not information[FLOOR, FLOOR]:  # without a floor the height stays where it is
            information[FLOOR, FLOOR] += _FIRM
            right_side[FLOOR] += _FIRM * start[FLOOR]
        if closed is not None:
            row = _turn_row(values)
            turn = angle(values[PANEL]) - angle(values[WALL])
            information += np.outer(row, row) / closed**2
            right_side += row * (row @ values - turn) / closed**2
        values = np.linalg.solve(information, right_side).astype(np.float64)
    return values, np.linalg.inv(information).astype(np.float64), counts
