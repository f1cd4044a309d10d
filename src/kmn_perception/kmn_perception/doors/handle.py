"""The handle: a bar or a knob that differs from the panel around it, near one of its edges."""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from kmn_perception.doors.settings import HandleSettings
from kmn_perception.doors.wall_view import WallFrame, WallView, resample
from kmn_perception.model.camera import Camera

_FLOOR_OF_NOISE = 0.005  # of the logarithm of grey
_PIXEL = 0.005  # metres
_JOINED = 3  # pixels of a handle that may look like the panel
_KNOB = 0.025  # metres from the middle of a knob to its rim


class Handle(NamedTuple):
    """A handle as it is seen on the panel.

    Attributes
    ----------
    side
        ``left`` or ``right``, as seen.
    kind
        ``lever`` or ``knob``.
    s, z
        Where the ray through its middle meets the panel: metres to the right of the camera along
        the panel, and above the floor.
    ratio
        Of its contrast to that of the panel's background.
    other
        Of its contrast to that at the panel's other edge.
    along_noise
        Standard deviation of ``s``, metres.
    """

    side: str
    kind: str
    s: float
    z: float
    ratio: float
    other: float
    along_noise: float


def find_handle(
    frame: WallFrame,
    edges: tuple[float, float],
    depth: NDArray[np.float32],
    grey: NDArray[np.float32] | None,
    camera: Camera,
    settings: HandleSettings,
    step_noise: float,
) -> Handle | None:
    """Find the handle of a panel, or None.

    Parameters
    ----------
    frame
        The panel's plane.
    edges
        Left and right, metres along it.
    depth, grey
        (height, width) metres, 0 for none; 0 to 1 or None.
    step_noise
        Standard deviation of means of inverse depths over the size of a handle, 1/m.
    """
    left, right = edges
    low, high = settings.heights
    margin = 2.0 * settings.bar[2]
    # What stands out is seen further from the point of the panel that is nearest to the camera.
    shifts = {s: settings.protrusion[0] * s / frame.distance for s in edges}
    s = np.arange(left - margin + min(shifts[left], 0.0), right + margin + max(0.0, shifts[right]), _PIXEL)
    z = np.arange(high + margin, low - margin, -_PIXEL)
    view = resample(frame, s, z, depth, grey, camera)
    windows = {
        "left": (s > left + shifts[left] - 0.01) & (s < left + shifts[left] + settings.reach),
        "right": (s < right + shifts[right] + 0.01) & (s > right + shifts[right] - settings.reach),
    }
    middle = ~(windows["left"] | windows["right"]) & (s > left) & (s < right)
    level = (z > low) & (z < high)
    if grey is not None:
        return _in_grey(view, windows, middle, level, edges, shifts, settings)
    return _in_depth(view, windows, level, settings, step_noise)


def _in_grey(
    view: WallView,
    windows: dict[str, NDArray[np.bool_]],
    middle: NDArray[np.bool_],
    level: NDArray[np.bool_],
    edges: tuple[float, float],
    shifts: dict[float, float],
    settings: HandleSettings,
) -> Handle | None:
    assert view.grey is not None
    known = cv2.erode(view.inside.astype(np.uint8), np.ones((15, 5), np.uint8)) > 0
    answer = np.abs(bar_response(view.grey, settings.bar)) * known
    background = answer[level][:, middle]
    if not background.size:
        return None
    noise = 1.48 * float(np.median(background)) + _FLOOR_OF_NOISE
    peaks = {side: float(answer[level][:, window].max(initial=0.0)) for side, window in windows.items()}
    side = max(peaks, key=lambda name: peaks[name])
    other = peaks[side] / max(peaks["right" if side == "left" else "left"], noise)
    ratio = peaks[side] / noise
    if peaks[side] < settings.min_contrast or ratio < settings.min_ratio or other < settings.min_other:
        return None
    masked = np.where(level[:, None] & windows[side], answer, 0.0)
    row, column = np.unravel_index(int(masked.argmax()), masked.shape)
    first, last = _extent(view.grey, int(row), int(column), settings)
    rows = slice(max(row - 4, 0), row + 5)
    weights = np.maximum(answer[rows, first : last + 1].mean(axis=1) - 0.5 * peaks[side] * 0.5, 0.0)
    z = float(np.average(view.z[rows], weights=weights if weights.sum() > 0.0 else None))
    length = view.s[last] - view.s[first]
    shift = shifts[edges[0] if side == "left" else edges[1]]
    kind = "lever" if length > settings.lever else "knob"
    noise_along = settings.along_noise
    middle_s = 0.5 * (view.s[first] + view.s[last])
    outward = -1.0 if side == "left" else 1.0
    if abs(shift) > 0.5 * settings.lever and shift * outward > 0.0:
        # A knob's neck is seen from its side, and looks like a lever: its head is the far end.
        end = view.s[last] if outward > 0.0 else view.s[first]
        if abs(length - abs(shift) - 2.0 * _KNOB) < 0.03:
            kind = "knob"
            middle_s = end - outward * _KNOB
        noise_along = max(noise_along, 0.25 * abs(shift))
    return Handle(side, kind, float(middle_s), z, ratio, other, noise_along)


def bar_response(grey: NDArray[np.float32], bar: tuple[float, float, float]) -> NDArray[np.float32]:
    """Return by how much a level bar about each pixel differs from what is above and below it.

    Where it is brighter than the one and darker than the other the answer is 0.
    """
    length, height, gap = (max(1, round(x / _PIXEL)) for x in bar)
    mean = cv2.blur(grey, (length, height), borderType=cv2.BORDER_REPLICATE)
    above = mean - np.roll(mean, gap, axis=0)
    below = mean - np.roll(mean, -gap, axis=0)
    same = above * below > 0.0
    return np.where(same, np.sign(above) * np.minimum(np.abs(above), np.abs(below)), 0.0)


def _extent(
    grey: NDArray[np.float32], row: int, column: int, settings: HandleSettings
) -> tuple[int, int]:
    """Return first and last column of what differs from the rows above and below."""
    gap = round(settings.bar[2] / _PIXEL)
    thin = cv2.blur(grey, (3, 3), borderType=cv2.BORDER_REPLICATE)
    rows = [min(max(row + k, 0), len(grey) - 1) for k in (-gap, 0, gap)]
    contrast = np.abs(thin[rows[1]] - 0.5 * (thin[rows[0]] + thin[rows[2]]))
    reach = round(0.12 / _PIXEL)
    window = slice(max(column - reach, 0), column + reach + 1)
    on_it = contrast > 0.4 * contrast[window].max()
    first = last = column
    for step in (-1, 1):
        end, misses = column, 0
        i = column
        while 0 <= i + step < len(on_it) and misses < _JOINED and abs(i - column) < 2 * reach:
            i += step
            misses = 0 if on_it[i] else misses + 1
            end = i if on_it[i] else end
        first, last = (end, last) if step < 0 else (first, end)
    return first, last


def _in_depth(
    view: WallView,
    windows: dict[str, NDArray[np.bool_]],
    level: NDArray[np.bool_],
    settings: HandleSettings,
    step_noise: float,
) -> Handle | None:
    """Find what stands out of the panel in depth, as only a near view shows it."""
    size = (round(settings.bar[0] / _PIXEL), round(2.0 * settings.bar[1] / _PIXEL))
    known = np.isfinite(view.offset)
    offset = np.clip(np.nan_to_num(view.offset, nan=0.0), -0.05, 0.08).astype(np.float32)
    share = cv2.blur(known.astype(np.float32), size, borderType=cv2.BORDER_CONSTANT)
    mean = cv2.blur(offset, size, borderType=cv2.BORDER_CONSTANT) / np.maximum(share, 0.5)
    far = cv2.blur(offset, (6 * size[0], 6 * size[1]), borderType=cv2.BORDER_REPLICATE)
    bump = np.where((share > 0.5) & level[:, None], mean - far, 0.0) / step_noise
    peaks = {side: float(bump[:, window].max(initial=0.0)) for side, window in windows.items()}
    side = max(peaks, key=lambda name: peaks[name])
    other = peaks[side] / max(peaks["right" if side == "left" else "left"], 1.0)
    if peaks[side] < settings.bump or other < settings.min_other:
        return None
    masked = np.where(windows[side], bump, 0.0)
    row, column = np.unravel_index(int(masked.argmax()), masked.shape)
    noise = 2.0 * settings.along_noise
    return Handle(
        side, "lever", float(view.s[column]), float(view.z[row]), peaks[side], other, noise
    )
