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
)  # fmt: skip
EDGES = slice(5, 9)  # of these: what is measured of the upright edges
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

    def to_world(self, point: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return world x, y of a vector (right, away)."""
        length = np.hypot(self.right, self.away)
        x = (point[0] * self.right + point[1] * self.away) / length
        y = (point[1] * self.right - point[0] * self.away) / length
        return np.array([x, y])


class DoorShape(NamedTuple):
    """Points of the panel's front, seen from above: (right, away) in the wall's axes, metres."""

    left: NDArray[np.float64]
    right: NDArray[np.float64]
    handle: NDArray[np.float64]
    handle_height: float
    top: float
    opening: float
    recess: float


def door_shape(m: NDArray[np.float64], handle_left: bool, ajar: bool) -> DoorShape:
    """Return the door's points from the measurements (13,), see `MEASURED`."""
    wall, panel = m[0:2], m[2:4]
    toward = -wall / np.linalg.norm(wall)  # the wall's normal, towards the camera
    corners = []
    for direction, on_panel in ((m[5], m[7]), (m[6], m[8])):
        ray = np.array([direction, 1.0])
        on_wall = ray / (wall @ ray)
        seen = ray / (panel @ ray)
        # The frame's edge, moved along the wall's normal onto the panel.
        behind = on_wall + toward * (1.0 - panel @ on_wall) / (panel @ toward)
        corners.append((1.0 - on_panel) * behind + on_panel * seen)
    left, right = corners
    turn = np.arctan2(panel[0], panel[1]) - np.arctan2(wall[0], wall[1])
    ray = np.array([m[10], 1.0])
    grip = ray * (1.0 - m[12] * np.linalg.norm(panel)) / (panel @ ray)
    hinge = right if handle_left else left
    at = hinge if ajar else 0.5 * (left + right)
    recess = (wall @ at - 1.0) / np.linalg.norm(wall)
    over = np.array([0.5 * (m[5] + m[6]), 1.0])
    top = 1.0 / m[4] + m[9] / (wall @ over)
    height = 1.0 / m[4] + m[11] * grip[1]
    return DoorShape(left, right, grip, height, top, turn, recess)


def door_values(
    m: NDArray[np.float64], handle_left: bool, ajar: bool, look: View2d
) -> NDArray[np.float64]:
    """Return the door's parameters (9,), see `DOOR`, from measurements (13,), see `MEASURED`."""
    shape = door_shape(m, handle_left, ajar)
    along = shape.right - shape.left
    width = float(np.linalg.norm(along))
    along = along / width
    latch, hinge = (shape.left, shape.right) if handle_left else (shape.right, shape.left)
    inset = float((shape.handle - latch) @ along) * (1.0 if handle_left else -1.0)
    axis = m[0:2] / np.linalg.norm(m[0:2]) if ajar else m[2:4] / np.linalg.norm(m[2:4])
    across = np.array([axis[1], -axis[0]])  # along the wall, to the right
    middle = hinge + across * (-0.5 if handle_left else 0.5) * width
    panel = m[2:4] / np.linalg.norm(m[2:4])
    middle = middle + panel * PANEL_FRONT  # it turns about a point of its middle plane
    x, y = look.to_world(middle)
    heading = look.to_world(axis)
    yaw = np.arctan2(heading[1], heading[0])
    door_height = shape.top - HEIGHT
    handle_z = shape.handle_height - HANDLE_HEIGHT - 0.5 * door_height
    return np.array(
        [
            x,
            y,
            yaw,
            door_height,
            width - WIDTH,
            inset - HANDLE_INSET,
            handle_z,
            shape.opening if handle_left else -shape.opening,
            shape.recess,
        ]
    )


def propagate(
    function: Callable[[NDArray[np.float64]], NDArray[np.float64]],
    at: NDArray[np.float64],
    covariance: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return a function's value and the covariance that it inherits, by its derivatives."""
    steps = 1e-2 * np.sqrt(np.diag(covariance)) + 1e-9
    columns = []
    for i, step in enumerate(steps):
        shift = np.zeros_like(at)
        shift[i] = step
        columns.append((function(at + shift) - function(at - shift)) / (2.0 * step))
    jacobian = np.stack(columns, axis=-1)
    return function(at), jacobian @ covariance @ jacobian.T
