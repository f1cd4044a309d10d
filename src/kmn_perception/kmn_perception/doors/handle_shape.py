"""What a kind of handle predicts for all pixels around it, and how well that explains an image.

A kind is made of the cuboids that the model has for it, in several lengths and with several
fittings behind it. Faces that look to the same side are equally bright, wherever they are seen:
before the panel, or beside it before the reveal. All else looks as it does above the handle: edges
are upright.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import NamedTuple

import cv2
import numpy as np
from numba import njit
from numpy.typing import NDArray

from kmn_perception.doors.part_settings import ShapeSettings
from kmn_perception.doors.settings import DoorSettings
from kmn_perception.doors.wall_view import WallFrame, WallView
from kmn_perception.model.room_model import RoomModel

KINDS = ("lever", "knob")
_SIDE, _LEVEL, _FRONT, _FITTING = range(1, 5)  # faces by where they look, and what is behind
_LENGTH = "handle_length"  # the nuisance that prolongs a lever
_BESIDE = "key"  # the fitting's part that is none behind the handle
_REAR_TO_FRONT = [0, 0, 1, 1]
_FRACTION = 4  # bits of a polygon's pixels
# What a cuboid's sides are, the corners between which they are, and where they look in the image.
_SIDES = (
    (_SIDE, 3, 0, 0, -1.0), (_SIDE, 1, 2, 0, 1.0), (_LEVEL, 2, 3, 1, -1.0), (_LEVEL, 0, 1, 1, 1.0),
)  # fmt: skip


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


class _Shapes(NamedTuple):
    """The cuboids of all shapes of a kind, see `_Box`: arrays (M, 2), and (M,) of the rest.

    ``shape`` is the number of the shape, of ``number``, that a cuboid belongs to.
    """

    number: int
    shape: NDArray[np.int64]
    before: NDArray[np.float64]
    along: NDArray[np.float64]
    up: NDArray[np.float64]
    label: NDArray[np.int64]
    protrusion: NDArray[np.float64]

    @classmethod
    def of(cls, shapes: Sequence[_Shape]) -> _Shapes:
        """Return the cuboids of shapes."""
        rows = [(i, *box, one.protrusion) for i, one in enumerate(shapes) for box in one.boxes]
        return cls(len(shapes), *(np.array(column) for column in zip(*rows, strict=True)))


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
    sums = np.zeros((len(grey), grey.shape[1] + 1, 3))
    np.cumsum(seen, axis=1, out=sums[:, 1:])
    labels = _labels(
        _shapes(kind, settings.lengths), view.frame, side, at, settings.template, pixel
    )
    window = _unexplained(
        sums, labels, (sliding.start, sliding.stop), (shifting.start, shifting.stop)
    )
    i, j = np.unravel_index(int(window.argmin()), window.shape)
    count = max(int(known.sum()), 1)
    misfit = (float((off * known).sum()) + float(window[i, j])) / count + settings.noise**2
    return Explanation(float(view.s[columns][shifting][j]), float(view.z[rows][sliding][i]), misfit)


def _window(middle: int, reach: float, pixel: float, count: int) -> slice:
    """Return the pixels within reach (metres) of a middle one."""
    steps = round(reach / pixel)
    return slice(max(middle - steps, 0), min(middle + steps + 1, count))


@njit(cache=True)
def _unexplained(
    sums: NDArray[np.float64],
    labels: NDArray[np.uint8],
    rows: tuple[int, int],
    columns: tuple[int, int],
) -> NDArray[np.float64]:
    """Return the squared error of the best shape, less that without one, by place of its middle.

    Parameters
    ----------
    sums
        (rows, columns + 1, 3) over the pixels to the left: of the squared grey less the squared
        error without a handle, of the grey, and of 1; nothing of pixels that are not known.
    labels
        (S, h, w) of what is seen of each shape about its middle; 0 beside it.
    rows, columns
        First and last + 1 of the places.
    """
    _, height, width = labels.shape
    least = np.full((rows[1] - rows[0], columns[1] - columns[0]), np.inf)
    faces = np.zeros((labels.max() + 1, 3))
    for shape in labels:
        runs = _runs(shape)
        for i in range(rows[0], rows[1]):
            for j in range(columns[0], columns[1]):
                faces[:] = 0.0
                for n in range(len(runs)):
                    y = i + runs[n, 0] - height // 2
                    if 0 <= y < sums.shape[0]:
                        begin = min(max(j + runs[n, 1] - width // 2, 0), sums.shape[1] - 1)
                        end = min(max(j + runs[n, 2] - width // 2, 0), sums.shape[1] - 1)
                        for k in range(3):
                            faces[runs[n, 3], k] += sums[y, end, k] - sums[y, begin, k]
                error = 0.0
                for label in range(len(faces)):
                    if faces[label, 2] > 0.5:
                        error += faces[label, 0] - faces[label, 1] ** 2 / faces[label, 2]
                least[i - rows[0], j - columns[0]] = min(least[i - rows[0], j - columns[0]], error)
    return least


@njit(cache=True)
def _runs(labels: NDArray[np.uint8]) -> NDArray[np.int64]:
    """Return the runs (N, 4) of labels: row, first and last + 1 column, and the label."""
    height, width = labels.shape
    runs = np.empty((height * width, 4), np.int64)
    count = 0
    for row in range(height):
        begin = 0
        for column in range(1, width + 1):
            if column == width or labels[row, column] != labels[row, begin]:
                if labels[row, begin] > 0:
                    runs[count, 0], runs[count, 1], runs[count, 2] = row, begin, column
                    runs[count, 3] = labels[row, begin]
                    count += 1
                begin = column
    return runs[:count]


def _labels(
    shapes: _Shapes,
    frame: WallFrame,
    side: str,
    at: tuple[float, float],
    half: tuple[float, float],
    pixel: float,
) -> NDArray[np.uint8]:
    """Return what is seen (S, rows, columns) of shapes whose middle is seen at a place.

    What stands before the panel is seen larger, and further from the point of the panel that is
    nearest to the camera.
    """
    rows, columns = (round(x / pixel) for x in half)
    labels = np.zeros((shapes.number, 2 * rows + 1, 2 * columns + 1), np.uint8)
    sign, distance, level = 1.0 if side == "right" else -1.0, frame.distance, at[1] - frame.height
    nearer = 1.0 - shapes.protrusion[:, None] / distance
    along = np.sort(at[0] * nearer + sign * shapes.along, axis=1)
    up = level * nearer + shapes.up
    scale = (distance / (distance - shapes.before))[..., None]
    # Of the rear and the front face the corners (M, 2, 4, 2): lower left first, then around.
    x = columns + (along[:, None] * scale - at[0]) / pixel
    y = rows - (up[:, None] * scale - level) / pixel
    corners = np.stack([x[..., [0, 1, 1, 0]], y[..., [0, 0, 1, 1]]], axis=-1)
    points = np.rint(corners * 2**_FRACTION).astype(np.int32, order="C")
    beyond = corners[:, 0] - corners[:, 1]
    sides = [
        (
            face,
            points[:, _REAR_TO_FRONT, [i, j, j, i]].copy("C"),
            outward * beyond[:, i, axis] > 0.0,
        )
        for face, i, j, axis, outward in _SIDES
    ]
    for m, shape in enumerate(shapes.shape):
        for face, outlines, is_seen in sides:
            if is_seen[m]:  # it is not hidden by the front
                cv2.fillConvexPoly(labels[shape], outlines[m], face, shift=_FRACTION)
        cv2.fillConvexPoly(labels[shape], points[m, 1], int(shapes.label[m]), shift=_FRACTION)
    return labels


@cache
def _shapes(kind: str, lengths: int) -> _Shapes:
    """Return a kind of handle in some lengths within the model's limits, with all fittings."""
    model = RoomModel.load(DoorSettings.load().model)
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
    return _Shapes.of(list(found))


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
