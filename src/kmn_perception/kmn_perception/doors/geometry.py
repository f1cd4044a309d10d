"""From what was measured to the door's parameters, with its covariance.

Measurements are directions of edges and handle, the lines of wall and panel seen from above, and
the camera's height. Everything else follows from them by geometry; `door_values` is that geometry,
and `propagate` carries the covariance through it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

# What is measured: see `Surfaces` for the first five.
MEASURED = (
    "wall_b", "wall_c", "panel_b", "panel_c", "inverse_height",
    "left", "right",              # directions, metres to the right per metre away
    "left_on_panel", "right_on_panel",  # 0: the edge seen is the frame's, 1: the panel's own
    "top_rise",                   # direction of the top, up per metre away, above the middle
    "handle", "handle_rise",      # directions to the right, and up, per metre away
    "protrusion",                 # of the handle's middle before the panel, metres
    "proud",                      # by how much the frame stands out of the wall, metres
)  # fmt: skip
EDGES = slice(5, 9)  # of these: what is measured of the upright edges
PROUD = 13
# What follows. Metres and radians; the world's origin lies on the floor below the camera, x points
# where the camera looks, z up. `x`, `y`, `yaw` are those of the closed door, and `opening` is
# positive away from the camera, see the model.
DOOR = (
    "x", "y", "yaw", "door_height", "door_width", "handle_y", "handle_z", "opening", "recess",
)  # fmt: skip
PANEL_FRONT = 0.019  # metres from the panel's middle plane to its front, as in the model
WIDTH, HEIGHT, HANDLE_HEIGHT, HANDLE_INSET = 0.8, 2.0, 1.0, 0.095  # of the prototype


class View2d(NamedTuple):
    """The horizontal direction in which the camera looks, to the right and away of the wall."""

    right: float
    away: float

    def to_world(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return world x, y of vectors (..., 2), right and away."""
        length = np.hypot(self.right, self.away)
        to_world = np.array([[self.right, -self.away], [self.away, self.right]]) / length
        return points @ to_world


class DoorShape(NamedTuple):
    """Points (..., 2) of the panel's front, seen from above: (right, away) in the wall's axes.

    Metres and radians; heights, opening and recess (...,).
    """

    left: NDArray[np.float64]
    right: NDArray[np.float64]
    handle: NDArray[np.float64]
    handle_height: NDArray[np.float64]
    top: NDArray[np.float64]
    opening: NDArray[np.float64]
    recess: NDArray[np.float64]


def door_shape(m: NDArray[np.float64], hinge_right: bool, ajar: bool) -> DoorShape:
    """Return the door's points from the measurements (..., 14), see `MEASURED`."""
    wall, panel = m[..., 0:2], m[..., 2:4]
    toward = -_unit(wall)  # the wall's normal, towards the camera
    front = wall / (1.0 - m[..., PROUD : PROUD + 1] * _length(wall))  # of the frame
    corners, frames = [], []
    for direction, on_panel in ((m[..., 5], m[..., 7]), (m[..., 6], m[..., 8])):
        ray = _ray(direction)
        on_frame = ray / _dot(front, ray)
        seen = ray / _dot(panel, ray)
        # The frame's edge, moved along the wall's normal onto the panel.
        behind = on_frame + toward * (1.0 - _dot(panel, on_frame)) / _dot(panel, toward)
        share = on_panel[..., None]
        corners.append((1.0 - share) * behind + share * seen)
        frames.append((on_frame, seen, share))
    hinge, swung = (1, 0) if hinge_right else (0, 1)
    if ajar:  # the swung edge is as far from the hinge as that of the frame
        on_frame, seen, share = frames[swung]
        apart = _dot(on_frame - corners[hinge], _along(wall))
        behind = corners[hinge] + apart * _along(panel)
        corners[swung] = (1.0 - share) * behind + share * seen
    left, right = corners
    turn = np.arctan2(panel[..., 0], panel[..., 1]) - np.arctan2(wall[..., 0], wall[..., 1])
    ray = _ray(m[..., 10])
    grip = ray * (1.0 - m[..., 12:13] * _length(panel)) / _dot(panel, ray)
    at = corners[hinge] if ajar else 0.5 * (left + right)
    recess = (_dot(wall, at) - 1.0) / _length(wall)
    over = _ray(0.5 * (m[..., 5] + m[..., 6]))
    top = 1.0 / m[..., 4] + m[..., 9] / _dot(wall, over)[..., 0]
    height = 1.0 / m[..., 4] + m[..., 11] * grip[..., 1]
    return DoorShape(left, right, grip, height, top, turn, recess[..., 0])


def door_values(
    m: NDArray[np.float64], hinge_right: bool, ajar: bool, look: View2d
) -> NDArray[np.float64]:
    """Return the parameters (..., 9), see `DOOR`, of measurements (..., 14), see `MEASURED`."""
    shape = door_shape(m, hinge_right, ajar)
    width = _length(shape.right - shape.left)
    along = (shape.right - shape.left) / width
    latch, hinge = (shape.left, shape.right) if hinge_right else (shape.right, shape.left)
    inset = _dot(shape.handle - latch, along)[..., 0] * (1.0 if hinge_right else -1.0)
    panel = _unit(m[..., 2:4])
    axis = _unit(m[..., 0:2])  # also of a panel that may be closed: its turn counts once
    across = axis @ np.array([[0.0, -1.0], [1.0, 0.0]])  # along the wall, to the right
    middle = hinge + across * (-0.5 if hinge_right else 0.5) * width
    middle = middle + panel * PANEL_FRONT  # it turns about a point of its middle plane
    place, heading = look.to_world(middle), look.to_world(axis)
    door_height = shape.top - HEIGHT
    return np.stack(
        [
            place[..., 0],
            place[..., 1],
            np.arctan2(heading[..., 1], heading[..., 0]),
            door_height,
            width[..., 0] - WIDTH,
            inset - HANDLE_INSET,
            shape.handle_height - HANDLE_HEIGHT - 0.5 * door_height,
            shape.opening if hinge_right else -shape.opening,
            shape.recess,
        ],
        axis=-1,
    )


def propagate(
    function: Callable[[NDArray[np.float64]], NDArray[np.float64]],
    at: NDArray[np.float64],
    covariance: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return a function's value and the covariance that it inherits, by its derivatives.

    Parameters
    ----------
    function
        Of vectors (..., N), for all at once.
    """
    steps = 1e-2 * np.sqrt(np.diag(covariance)) + 1e-9
    shifts = np.diag(steps)
    values = function(np.concatenate([at[None], at + shifts, at - shifts]))
    above, below = np.split(values[1:], 2)
    jacobian = ((above - below) / (2.0 * steps[:, None])).T
    return values[0], jacobian @ covariance @ jacobian.T


def _ray(direction: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the rays (..., 2), right and away, of directions (...,)."""
    return np.stack([direction, np.ones_like(direction)], axis=-1)


def _dot(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the products (..., 1) of vectors (..., 2)."""
    return a[..., :1] * b[..., :1] + a[..., 1:] * b[..., 1:]


def _length(a: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the lengths (..., 1) of vectors (..., 2)."""
    return np.hypot(a[..., :1], a[..., 1:])


def _along(line: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the directions (..., 2) along lines (b, c), to the right."""
    return np.stack([line[..., 1], -line[..., 0]], axis=-1) / _length(line)


def _unit(a: NDArray[np.float64]) -> NDArray[np.float64]:
    return a / _length(a)
