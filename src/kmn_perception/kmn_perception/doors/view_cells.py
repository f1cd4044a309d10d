"""What the network sees of a wall's view: coarse cells of gradients, offsets and masks."""

from __future__ import annotations

from typing import Any, overload

import cv2
import numpy as np
from numpy.typing import NDArray

from kmn_perception.doors.lines import gaussian_steps
from kmn_perception.doors.settings import DoorSettings
from kmn_perception.doors.wall_view import WallView

ROWS = 64  # cells above each other, from the view's top
_HIGH, WIDE = 8, 4  # pixels of the view in a cell
_SMOOTHING = 1.5  # pixels
_STEP, _OFFSET = 0.4, 12.0  # largest step of the logarithm of grey, and offset in pixel noises
_ASIDE = 2.0  # largest tangent of the angle to the wall's normal


def cells_of(view: WallView, noise: float, before: float) -> NDArray[np.float32]:
    """Return the cells (7, ROWS, N) of a view, -1 to 1.

    They are: step to the right and step downwards of the logarithm of grey, offset of the inverse
    depth, the shares that are measured, in the image, and hidden by something before the wall, and
    how far the camera looks aside: on one side of a door it sees into the reveal.

    Parameters
    ----------
    noise
        Standard deviation of an inverse depth, 1/m.
    before
        Offset of the inverse depth from which something stands before the wall, 1/m.
    """
    shade = np.zeros_like(view.offset) if view.grey is None else view.grey
    within = cv2.erode(view.inside.astype(np.uint8), np.ones((9, 9), np.uint8)) > 0
    right = _whole(gaussian_steps(shade, _SMOOTHING) * within)
    down = _whole(gaussian_steps(shade, _SMOOTHING, axis=0) * within)
    columns = right.shape[1] // WIDE
    right = _mean_to(right, (right.shape[1], ROWS)).reshape(ROWS, columns, WIDE)
    down = _mean_to(down, (columns, len(down))).reshape(ROWS, _HIGH, columns)
    measured = np.isfinite(view.offset)
    offset = np.where(measured, view.offset, np.float32(0.0))
    share = _mean(measured.astype(np.float32))
    scaled = _mean(np.clip(offset / noise, -_OFFSET, _OFFSET)) / np.maximum(share, 1e-3)
    channels = [
        np.clip(_strongest(right, axis=2) / _STEP, -1.0, 1.0),
        np.clip(_strongest(down, axis=1) / _STEP, -1.0, 1.0),
        np.clip(scaled * (share > 0.1) / _OFFSET, -1.0, 1.0),
        2.0 * share - 1.0,
        2.0 * _mean(view.inside.astype(np.float32)) - 1.0,
        2.0 * _mean((offset > before).astype(np.float32)) - 1.0,
    ]
    middles = column_of(view, np.arange(columns, dtype=np.float64))
    aside = view.s[0] + middles * (view.s[1] - view.s[0])
    level = np.clip(aside / view.frame.distance / _ASIDE, -1.0, 1.0)
    channels.append(np.broadcast_to(level, (ROWS, columns)))
    return np.stack(channels).astype(np.float32)


def column_of(view: WallView, cell: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the column of the view in the middle of a cell's column."""
    return cell * WIDE + 0.5 * (WIDE - 1)


@overload
def cell_of(view: WallView, column: float) -> float: ...
@overload
def cell_of(view: WallView, column: NDArray[np.float64]) -> NDArray[np.float64]: ...
def cell_of(view: WallView, column: float | NDArray[np.float64]) -> float | NDArray[np.float64]:
    """Return the cells' columns of columns of the view."""
    return (column - 0.5 * (WIDE - 1)) / WIDE


def row_of(view: WallView, row: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return the cell's row of rows of the view."""
    return (row - 0.5 * (_HIGH - 1)) / _HIGH


def height_of(view: WallView, row: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the height above the floor of the middle of a cell's row, metres."""
    pixel = float(view.z[0] - view.z[1])
    return float(view.z[0]) - pixel * (row * _HIGH + 0.5 * (_HIGH - 1))


def _whole(values: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the values of whole cells; missing rows at the bottom are 0."""
    values = values[: ROWS * _HIGH, : values.shape[1] // WIDE * WIDE]
    missing = ROWS * _HIGH - len(values)
    return np.pad(values, ((0, missing), (0, 0))) if missing else values


def _mean(values: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the means (ROWS, N) of cells."""
    values = _whole(values)
    return _mean_to(values, (values.shape[1] // WIDE, ROWS))


def _mean_to(values: NDArray[np.float32], size: tuple[int, int]) -> NDArray[np.float32]:
    """Return the means of blocks, as many as a size (columns, rows) has."""
    means = cv2.resize(np.ascontiguousarray(values), size, interpolation=cv2.INTER_AREA)
    return np.asarray(means, dtype=np.float32)


def _strongest(values: NDArray[np.float32], axis: int) -> NDArray[np.float32]:
    """Return the value of largest size along an axis."""
    at = np.expand_dims(np.abs(values).argmax(axis=axis), axis)
    return np.take_along_axis(values, at, axis).squeeze(axis)


def describe_cells(settings: DoorSettings) -> dict[str, Any]:
    """Return how cells are made, as their network's weight file must agree on it: by name."""
    view, noise = settings.view, settings.fit.pixel_noise
    return {
        "rows": ROWS,
        "pixels": [_HIGH, WIDE],
        "pixel": view.pixel,
        "heights": list(view.heights),
        "smoothing": _SMOOTHING,
        "step": _STEP,
        "offset": _OFFSET * noise,
        "before": view.before * noise,
        "aside": _ASIDE,
    }
