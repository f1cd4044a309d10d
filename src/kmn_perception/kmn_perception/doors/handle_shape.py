"""What a kind of handle predicts for all pixels around it, and how well that explains an image.

A kind is made of the cuboids that the model has for it, in several lengths and with several
fittings behind it. Faces that look to the same side are equally bright, wherever they are seen:
before the panel, or beside it before the reveal. All else looks as it does above the handle: edges
are upright.
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from kmn_perception.doors.part_settings import ShapeSettings
from kmn_perception.doors.wall_view import WallFrame, WallView
from kmn_perception.model.room_model import RoomModel
from kmn_perception.network import wall_weights

KINDS = ("lever", "knob")
_SIDE, _LEVEL, _FRONT, _FITTING = range(1, 5)  # faces by where they look, and what is behind
_LENGTH = "handle_length"  # the nuisance that prolongs a lever
_BESIDE = "key"  # the fitting's part that is none behind the handle
_FRACTION = 4  # bits of a polygon's pixels


class Explanation(NamedTuple):
    """How well a kind of handle explains what is seen.

    Attributes
    ----------
    s, z
        Where the ray through its middle meets the panel then, see `Handle`.
    misfit
        Mean squared difference of what is predicted, with the settings' noise.
    """

    s: float
    z: float
    misfit: float


class _Box(NamedTuple):
    """A cuboid, metres before the panel, towards the latch, and up from the handle's middle."""

    before: tuple[float, float]
    along: tuple[float, float]
    up: tuple[float, float]
    label: int  # of its front


class _Shape(NamedTuple):
    """Cuboids from the rearmost on, and the middle's distance from the panel, metres."""

    boxes: tuple[_Box, ...]
    protrusion: float


def explain(
    view: WallView, kind: str, side: str, at: tuple[float, float], settings: ShapeSettings
) -> Explanation:
    """Return where a kind of handle explains best what is seen about a place, and how well.

    Parameters
    ----------
    view
        Of the panel, with its grey.
    kind, side
        One of ``KINDS``, and where the latch is as seen, ``left`` or ``right``.
    at
        About where its middle is seen: metres along the panel and above the floor.
    """
    assert view.grey is not None
    pixel = float(view.s[1] - view.s[0])
    row, column = (int(np.abs(axis - x).argmin()) for axis, x in ((view.z, at[1]), (view.s, at[0])))
    at = float(view.s[column]), float(view.z[row])
    half_z, half_s = (round(x / pixel) for x in settings.around)
    above = slice(*(max(row - round(x / pixel), 0) for x in reversed(settings.above)))
    beside = view.grey[above].mean(axis=0) if above.stop > above.start else view.grey[row]
    rows = slice(max(row - half_z, 0), row + half_z + 1)
    columns = slice(max(column - half_s, 0), column + half_s + 1)
    grey, known = view.grey[rows, columns], view.inside[rows, columns]
    off = np.minimum((grey - beside[columns]) ** 2, settings.clip**2)
    seen = np.dstack([grey**2 - off, grey, np.ones_like(grey)]) * known[..., None]
    sliding = _window(row - rows.start, settings.reach[1], pixel, len(grey))
    shifting = _window(column - columns.start, settings.reach[0], pixel, grey.shape[1])
    shapes = _shapes(kind, settings.lengths)
    drawn = (_labels(one, view.frame, side, at, settings.template, pixel) for one in shapes)
    least = np.min([_unexplained(seen.astype(np.float32), labels) for labels in drawn], axis=0)
    window = least[sliding, shifting]
    i, j = np.unravel_index(int(window.argmin()), window.shape)
    count = max(int(known.sum()), 1)
    misfit = (float((off * known).sum()) + float(window[i, j])) / count + settings.noise**2
    return Explanation(float(view.s[columns][shifting][j]), float(view.z[rows][sliding][i]), misfit)


def _window(middle: int, reach: float, pixel: float, count: int) -> slice:
    """Return the pixels within reach (metres) of a middle one."""
    steps = round(reach / pixel)
    return slice(max(middle - steps, 0), min(middle + steps + 1, count))


def _unexplained(seen: NDArray[np.float32], labels: NDArray[np.uint8]) -> NDArray[np.float32]:
    """Return the squared error (rows, columns) of a shape at each place, less that without one.

    Parameters
    ----------
    seen
        (rows, columns, 3) of each pixel: the squared grey less the squared error without a handle,
        the grey, and 1; all are 0 where nothing is known.
    labels
        (rows, columns) of what is seen of the shape about its middle; 0 beside it.
    """
    error = np.zeros(seen.shape[:2], np.float32)
    for label in np.unique(labels[labels > 0]):
        mask = (labels == label).astype(np.float32)
        sums = cv2.filter2D(seen, cv2.CV_32F, mask, borderType=cv2.BORDER_CONSTANT)
        error += sums[..., 0] - sums[..., 1] ** 2 / np.maximum(sums[..., 2], 0.5)
    return error


def _labels(
    shape: _Shape,
    frame: WallFrame,
    side: str,
    at: tuple[float, float],
    half: tuple[float, float],
    pixel: float,
) -> NDArray[np.uint8]:
    """Return what is seen (rows, columns) of a shape whose middle is seen at a place.

    What stands before the panel is seen larger, and further from the point of the panel that is
    nearest to the camera.
    """
    rows, columns = (round(x / pixel) for x in half)
    labels = np.zeros((2 * rows + 1, 2 * columns + 1), np.uint8)
    sign, distance, height = 1.0 if side == "right" else -1.0, frame.distance, frame.height
    nearer = 1.0 - shape.protrusion / distance
    middle = at[0] * nearer, (at[1] - height) * nearer

    def rectangle(before: float, box: _Box) -> NDArray[np.float64]:
        """Return the corners (4, 2) of a box's face, pixels: lower left first, then around."""
        scale = distance / (distance - before)
        left, right = sorted(middle[0] + sign * a for a in box.along)
        low, high = (middle[1] + z for z in box.up)
        corners = np.array([[left, low], [right, low], [right, high], [left, high]]) * scale
        off = (corners - [at[0], at[1] - height]) / pixel
        return np.column_stack([columns + off[:, 0], rows - off[:, 1]])

    def fill(corners: NDArray[np.float64], label: int) -> None:
        points = np.rint(corners * 2**_FRACTION).astype(np.int32)
        cv2.fillConvexPoly(labels, points, label, shift=_FRACTION)

    for box in shape.boxes:
        back, front = (rectangle(before, box) for before in box.before)
        for i, j, axis, outward in ((3, 0, 0, -1), (1, 2, 0, 1), (2, 3, 1, -1), (0, 1, 1, 1)):
            if outward * (back[i, axis] - front[i, axis]) > 0.0:  # it is not hidden by the front
                face = _SIDE if axis == 0 else _LEVEL
                fill(np.array([back[i], back[j], front[j], front[i]]), face)
        fill(front, box.label)
    return labels


@cache
def _shapes(kind: str, lengths: int) -> tuple[_Shape, ...]:
    """Return a kind of handle in some lengths within the model's limits, with all fittings."""
    model = RoomModel.load(wall_weights.MODEL)
    door, names = model.model, [parameter.name for parameter in model.nuisance]
    usual = np.zeros(len(door.gamma))
    panel, grip = door.body("panel"), door.body("handle").centre(usual)
    face = float(panel.centre(usual)[0] - panel.size(usual)[0] / 2.0)
    limits = model.nuisance[names.index(_LENGTH)].limits
    found: dict[_Shape, None] = {}
    for length in np.linspace(*limits, lengths):
        both = np.concatenate([usual, model.nuisances(**{_LENGTH: float(length)})])
        parts = sorted(model.handles[kind], key=lambda part: -part.centre(both)[0])
        bodies = [(grip + part.centre(both), part.size(both), _FRONT) for part in parts]
        foot = np.array([face, *(grip + parts[0].centre(both))[1:]])
        for fitting in model.fittings.values():
            behind = [
                (foot + part.centre(both), part.size(both), _FITTING)
                for part in fitting
                if part.name != _BESIDE
            ]
            boxes = tuple(_box(*body, grip, face) for body in (*behind, *bodies))
            found[_Shape(boxes, face - float(grip[0]))] = None
    return tuple(found)


def _box(
    centre: NDArray[np.float64],
    size: NDArray[np.float64],
    label: int,
    grip: NDArray[np.float64],
    face: float,
) -> _Box:
    low, high = centre - size / 2.0, centre + size / 2.0
    y, z = float(grip[1]), float(grip[2])  # y points away from the latch
    return _Box(
        (face - float(high[0]), face - float(low[0])),
        (y - float(high[1]), y - float(low[1])),
        (float(low[2]) - z, float(high[2]) - z),
        label,
    )
