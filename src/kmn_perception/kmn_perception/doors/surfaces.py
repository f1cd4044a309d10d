"""One fit of wall, panel, floor and calibration to the inverse depths about a pair of edges.

Seen from above, with x to the right and y away from the camera, a vertical plane is the line
b x + c y = 1, and a ray (x, y, up) sees the inverse depth b x + c y there. The floor at a height h
below gives -up / h. A sensor whose calibration is off adds an offset to all of them, and a warp
over the image; they show where the floor or a tilted view ties depths to the vertical, and where
wall and panel should be parallel. All of this is linear.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kmn_perception.doors.inverse_depth import Blocks
from kmn_perception.doors.settings import Calibration, FitSettings
from kmn_perception.doors.wall_view import WallFrame

WALL, PANEL, FLOOR, TILT, OFFSET, WARP = slice(0, 2), slice(2, 4), 4, slice(5, 7), 7, slice(7, 11)
FLOOR_OFFSET, SIZE = 11, 12
_TRIALS, _ROUNDS = 150, 5
_LOW, _HIGH, _PANEL_HIGH = 0.1, 2.4, 1.95  # metres above the floor between which blocks are taken
_MAX_TURN = 0.6  # radians to the plane that was found


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
    panel_share
        Share of the unhidden measured blocks between the edges that lie on the panel.
    panel_visible
        Share of all blocks between the edges that are measured and unhidden.
    opening
        Angle of the panel to the wall, radians, positive to the right; 0 if it counts as closed.
    """

    values: NDArray[np.float64]
    covariance: NDArray[np.float64]
    wall_blocks: int
    panel_blocks: int
    panel_share: float
    panel_visible: float
    opening: float


class _Data(NamedTuple):
    """Blocks: rays in the wall's axes, right, away, up (N,); warp (N, 4); inverse depths (N,)."""

    x: NDArray[np.float64]
    y: NDArray[np.float64]
    up: NDArray[np.float64]
    warp: NDArray[np.float64]
    inverse: NDArray[np.float64]


def fit_surfaces(
    blocks: Blocks,
    frame: WallFrame,
    edges: tuple[float, float],
    floor: bool,
    calibration: Calibration,
    settings: FitSettings,
) -> Surfaces | None:
    """Fit wall, panel and floor about two edges; None where wall or panel are hardly measured.

    Parameters
    ----------
    edges
        Directions of the left and right edge, metres to the right per metre away.
    floor
        Whether the frame's height is known from the floor.
    calibration
        Of the sensor.
    """
    rays, inverse, valid = blocks.flat()
    u, v = rays[:, 0], rays[:, 1]
    warp = np.stack([np.ones_like(u), u, v, u * u], axis=-1)
    data = _Data(rays @ frame.right, -rays @ frame.normal, rays @ frame.up, warp, inverse)
    ahead = data.y > 0.0
    with np.errstate(divide="ignore", invalid="ignore"):
        side = np.where(ahead, data.x / data.y, np.inf) * frame.distance
        height = np.where(ahead, data.up / data.y, np.inf) * frame.distance + frame.height
    left, right = (edge * frame.distance for edge in edges)
    level = ahead & (height > _LOW) & (height < _HIGH)
    frame_left, frame_right = left - settings.frame, right + settings.frame
    beside = (side < frame_left) & (side > frame_left - settings.beside)
    beside |= (side > frame_right) & (side < frame_right + settings.beside)
    inside = (side > left + settings.margin) & (side < right - settings.margin)
    inside &= level & (height < _PANEL_HIGH)
    offset = inverse - rays @ frame.vector
    near = valid & (np.abs(offset) < settings.reach)
    regions = [near & level & beside, near & inside]
    lines = [_start(data, region, settings) for region in regions]
    if any(line is None for line in lines):
        return None
    wall, panel = lines
    below = valid & (data.up < 0.0) if floor else np.zeros_like(valid)
    start = np.array([*wall, *panel, 1.0 / frame.height, *np.zeros(SIZE - 5)])
    values, covariance, masks = _solve(
        data, (*regions, below), start, None, calibration, blocks.size, settings
    )
    if min(masks[0].sum(), masks[1].sum()) < settings.min_blocks:
        return None
    opening = _opening(values, covariance, settings)
    if opening == 0.0:
        values, covariance, masks = _solve(
            data, (*regions, below), values, settings.closed, calibration, blocks.size, settings
        )
    unhidden = valid & inside & (offset < settings.reach)
    hidden = valid & inside & (offset >= settings.reach)
    on_panel = unhidden & (
        np.abs(_predict(values, data, PANEL) - inverse) < settings.inlier * settings.pixel_noise
    )
    return Surfaces(
        values=values,
        covariance=covariance,
        wall_blocks=int(masks[0].sum()),
        panel_blocks=int(masks[1].sum()),
        panel_share=float(on_panel.sum() / max(1, (inside & ~hidden).sum())),
        panel_visible=float(unhidden.sum() / max(1, inside.sum())),
        opening=opening,
    )


def angle(line: NDArray[np.float64]) -> float:
    """Return the turn of a line (b, c) to the right, radians."""
    return float(np.arctan2(line[0], line[1]))


def _opening(
    values: NDArray[np.float64], covariance: NDArray[np.float64], settings: FitSettings
) -> float:
    turn = angle(values[PANEL]) - angle(values[WALL])
    deviation = float(np.sqrt(_turn_row(values) @ covariance @ _turn_row(values)))
    least, deviations = settings.ajar
    return turn if abs(turn) > max(least, deviations * deviation) else 0.0


def _turn_row(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the derivatives (12,) of the panel's angle to the wall."""
    row = np.zeros(SIZE)
    for part, sign in ((PANEL, 1.0), (WALL, -1.0)):
        b, c = values[part]
        row[part] = sign * np.array([c, -b]) / (b * b + c * c)
    return row


def _start(
    data: _Data, region: NDArray[np.bool_], settings: FitSettings
) -> NDArray[np.float64] | None:
    """Return the line (b, c) that most blocks of a region lie on."""
    some = np.flatnonzero(region)
    if len(some) < settings.min_blocks:
        return None
    generator = np.random.default_rng(0)
    pairs = generator.choice(some, (_TRIALS, 2))
    rows = np.stack([data.x[pairs], data.y[pairs]], axis=-1)
    apart = np.abs(np.linalg.det(rows)) > 0.02
    if not apart.any():
        return None
    lines = np.linalg.solve(rows[apart], data.inverse[pairs[apart]][..., None])[..., 0]
    lines = lines[(lines[:, 1] > 0.0) & (np.abs(np.arctan2(*lines.T)) < _MAX_TURN)]
    if not len(lines):
        return None
    seen = np.stack([data.x[some], data.y[some]], axis=-1)
    off = np.abs(seen @ lines.T - data.inverse[some, None])
    near = off < settings.inlier * settings.pixel_noise
    best: NDArray[np.float64] = lines[near.sum(axis=0).argmax()]
    return best


def _rows(
    data: _Data, mask: NDArray[np.bool_], part: slice | int, values: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the derivatives (N, 12) of the inverse depths of blocks on a surface."""
    x, y, up = data.x[mask], data.y[mask], data.up[mask]
    rows = np.zeros((len(x), SIZE))
    rows[:, WARP] = data.warp[mask]
    if isinstance(part, slice):
        rows[:, part] = np.stack([x, y], axis=-1)
        rows[:, TILT] = -up[:, None] * values[part]
    else:
        rows[:, part] = -up
        rows[:, FLOOR_OFFSET] = 1.0
        rows[:, TILT] = -values[part] * np.stack([x, y], axis=-1)
    return rows


def _predict(
    values: NDArray[np.float64], data: _Data, part: slice | int
) -> NDArray[np.float64]:
    """Return the inverse depths (N,) that a surface has in all blocks."""
    every = np.ones(len(data.x), dtype=np.bool_)
    return _rows(data, every, part, values) @ values


def _solve(
    data: _Data,
    regions: tuple[NDArray[np.bool_], ...],
    start: NDArray[np.float64],
    closed: float | None,
    calibration: Calibration,
    size: int,
    settings: FitSettings,
) -> tuple[NDArray[np.float64], NDArray[np.float64], list[NDArray[np.bool_]]]:
    """Return values, covariance, and the blocks that lie on each surface."""
    values = start.copy()
    # So many neighbouring blocks know as much as one of them without noise of its own.
    alone = (settings.block_noise, settings.block_noise, settings.floor_noise)
    weights = [(noise * settings.correlation / size) ** -2.0 for noise in alone]
    reach = settings.inlier * settings.pixel_noise
    prior = np.zeros((SIZE, SIZE))
    slope = calibration.slope
    deviations = np.array([calibration.offset, slope, slope, calibration.bend])
    prior[WARP, WARP] = np.diag(deviations**-2.0)
    prior[FLOOR_OFFSET, FLOOR_OFFSET] = calibration.floor**-2.0
    prior[TILT, TILT] = np.eye(2) / settings.tilt**2
    masks: list[NDArray[np.bool_]] = []
    for _ in range(_ROUNDS):
        information, right_side = prior.copy(), np.zeros(SIZE)
        masks = []
        for part, region, weight in zip((WALL, PANEL, FLOOR), regions, weights, strict=True):
            mask = region & (np.abs(_predict(values, data, part) - data.inverse) < reach)
            rows = _rows(data, mask, part, values)
            information += weight * rows.T @ rows
            right_side += weight * rows.T @ data.inverse[mask]
            masks.append(mask)
        if not masks[2].any():
            information[FLOOR, FLOOR] += 1e6  # not observed: stays where it is
            right_side[FLOOR] += 1e6 * start[FLOOR]
        if closed is not None:
            row = _turn_row(values)
            turn = angle(values[PANEL]) - angle(values[WALL])
            information += np.outer(row, row) / closed**2
            right_side += row * (row @ values - turn) / closed**2
        values = np.linalg.solve(information, right_side)
    return values, np.linalg.inv(information), masks
