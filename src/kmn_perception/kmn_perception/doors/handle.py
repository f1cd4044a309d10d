"""The handle: a bar or a knob that differs from the panel around it, near one of its edges."""

from __future__ import annotations

from collections.abc import Collection
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from kmn_perception.doors.handle_kind import kind_of
from kmn_perception.doors.part_settings import HandleSettings
from kmn_perception.doors.wall_view import WallFrame, WallView, resample
from kmn_perception.model.camera import Camera

_FLOOR_OF_NOISE = 0.005  # of the logarithm of grey
_PIXEL = 0.005  # metres


class Hint(NamedTuple):
    """Where a network sees a handle.

    Attributes
    ----------
    kind, lever_odds
        Its kind, and how much likelier a lever is than a knob.
    s, z
        Its place on the panel, metres.
    probability
        That it is there.
    """

    kind: str
    lever_odds: float
    s: float
    z: float
    probability: float


class Handle(NamedTuple):
    """A handle as it is seen on the panel.

    Attributes
    ----------
    side
        ``left`` or ``right``, as seen.
    kind
        ``lever``, ``knob`` or ``bar``; empty where a lever and a knob are nearly as likely.
    odds
        How much likelier than the other a lever or a knob is.
    s, z
        Where the ray through its middle meets the panel: metres to the right of the camera along
        the panel, and above the floor.
    ratio
        Of its contrast to that of the panel's background.
    other
        Of its contrast to that at the panel's other edge.
    along_noise, up_noise
        Standard deviations of ``s`` and ``z``, metres.
    """

    side: str
    kind: str
    odds: float
    s: float
    z: float
    ratio: float
    other: float
    along_noise: float
    up_noise: float


def find_handle(
    frame: WallFrame,
    edges: tuple[float, float],
    sides: Collection[str],
    depth: NDArray[np.float32],
    grey: NDArray[np.float32] | None,
    camera: Camera,
    settings: HandleSettings,
    step_noise: float,
    hint: Hint | None,
) -> Handle | None:
    """Find the handle of a panel, or None.

    Parameters
    ----------
    frame
        The panel's plane.
    edges
        Left and right, metres along it.
    sides
        At which of them it may be.
    depth, grey
        (height, width) metres, 0 for none; 0 to 1 or None.
    step_noise
        Standard deviation of means of inverse depths over the size of a handle, 1/m.
    hint
        Where a network sees it; None without one.
    """
    left, right = edges
    low, high = settings.heights
    margin = 2.0 * settings.bar[2]
    # What stands out is seen further from the point of the panel that is nearest to the camera.
    shifts = {s: settings.protrusion[0] * s / frame.distance for s in edges}
    first, last = left + min(shifts[left], 0.0), right + max(shifts[right], 0.0)
    s = np.arange(first - margin, last + margin, _PIXEL, dtype=np.float64)
    z = np.arange(high + margin, low - margin, -_PIXEL, dtype=np.float64)
    view = resample(frame, s, z, depth, grey, camera)
    windows = {
        "left": (s > left + shifts[left] - 0.01) & (s < left + shifts[left] + settings.reach),
        "right": (s < right + shifts[right] + 0.01) & (s > right + shifts[right] - settings.reach),
    }
    middle = ~(windows["left"] | windows["right"]) & (s > left) & (s < right)
    windows = {side: window & (side in sides) for side, window in windows.items()}
    level = (z > low) & (z < high)
    if grey is not None:
        return _in_grey(view, windows, middle, level, edges, settings, hint)
    return _in_depth(view, windows, level, settings, step_noise)


def _in_grey(
    view: WallView,
    windows: dict[str, NDArray[np.bool_]],
    middle: NDArray[np.bool_],
    level: NDArray[np.bool_],
    edges: tuple[float, float],
    settings: HandleSettings,
    hint: Hint | None,
) -> Handle | None:
    assert view.grey is not None
    known = cv2.erode(view.inside.astype(np.uint8), np.ones((15, 5), np.uint8)) > 0
    answer = np.abs(bar_response(view.grey, settings.bar)) * known * level[:, None]
    if not (background := answer[level][:, middle]).size:
        return None
    noise = 1.48 * float(np.median(background)) + _FLOOR_OF_NOISE
    # A darker surface beside the panel may be noisier.
    noises = {
        side: max(noise, 1.48 * float(np.median(answer[level][:, window])) if window.any() else 0.0)
        for side, window in windows.items()
    }
    trust = settings.alone if hint is None else settings.doubted
    if hint is not None and hint.probability > settings.min_probability:
        trust = settings.confirmed
        near = np.abs(view.s - hint.s) < settings.hint_reach
        answer = answer * near * (np.abs(view.z - hint.z) < settings.hint_reach)[:, None]
    peaks = {side: float(answer[:, window].max(initial=0.0)) for side, window in windows.items()}
    side = max(peaks, key=lambda name: peaks[name])
    noise = noises[side]
    other = peaks[side] / max(peaks["right" if side == "left" else "left"], noise)
    ratio = peaks[side] / noise
    if peaks[side] < trust.contrast or ratio < trust.ratio or other < trust.other:
        return _as_hinted(hint, edges, windows, settings)
    if hint is not None and trust is settings.confirmed and hint.kind == "bar":
        return _as_hinted(hint, edges, windows, settings)
    masked = np.where(windows[side], answer, 0.0)
    row, column = np.unravel_index(int(masked.argmax()), masked.shape)
    at = float(view.s[column]), float(view.z[row])
    seen = hint if trust is settings.confirmed else None
    found = kind_of(view, side, at, 1.0 if seen is None else seen.lever_odds, settings)
    along, up = found.along, found.up
    if seen is not None:  # by how much both disagree beyond what the network knows
        along = np.hypot(along, max(abs(found.s - seen.s) - settings.hint_noise[0], 0.0))
        up = np.hypot(up, max(abs(found.z - seen.z) - settings.hint_noise[1], 0.0))
    kind = found.kind if found.odds > settings.min_odds else ""
    return Handle(side, kind, found.odds, found.s, found.z, ratio, other, float(along), float(up))


def _as_hinted(
    hint: Hint | None,
    edges: tuple[float, float],
    windows: dict[str, NDArray[np.bool_]],
    settings: HandleSettings,
) -> Handle | None:
    """Return the handle that the network alone sees, if it is sure of it."""
    if hint is None or hint.probability < settings.sure:
        return None
    side = "left" if abs(hint.s - edges[0]) < abs(hint.s - edges[1]) else "right"
    low, high = settings.heights
    if not windows[side].any() or not low <= hint.z <= high:
        return None
    along, up = settings.hint_noise
    kind, odds = hint.kind, max(hint.lever_odds, 1.0 / hint.lever_odds)
    if kind == "bar":
        up = settings.bar_noise
    elif odds < settings.min_odds:
        kind = ""
    return Handle(side, kind, odds, hint.s, hint.z, settings.alone.ratio, np.inf, along, up)


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
    anywhere = np.where(share > 0.5, mean - far, 0.0) / step_noise
    bump = np.where(level[:, None], anywhere, 0.0)
    peaks = {side: float(bump[:, window].max(initial=0.0)) for side, window in windows.items()}
    side = max(peaks, key=lambda name: peaks[name])
    other = peaks[side] / max(peaks["right" if side == "left" else "left"], 1.0)
    if peaks[side] < settings.bump or other < settings.alone.other:
        return None
    masked = np.where(windows[side], bump, 0.0)
    row, column = np.unravel_index(int(masked.argmax()), masked.shape)
    if anywhere[max(row - 2, 0) : row + 3, column].max() > peaks[side]:
        return None  # it goes on above or below where handles are
    along, up = settings.hint_noise
    return Handle(
        side,
        "lever",
        np.inf,
        float(view.s[column]),
        float(view.z[row]),
        peaks[side],
        other,
        along,
        up,
    )
