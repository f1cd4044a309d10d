"""What the network is to find in a view of a wall, in the cells that it sees."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kmn_perception.doors.view_cells import cell_of, height_of
from kmn_perception.doors.wall_view import WallView
from kmn_perception.network.wall_network import EDGES as EDGE_NAMES
from kmn_perception.network.wall_network import KINDS
from kmn_perception.rooms.design import EDGES, seen_edges, seen_opening, seen_panel_edges
from kmn_perception.rooms.rendering import Images
from kmn_perception.rooms.room import Door, Room
from kmn_perception.training.wall.settings import TargetSettings

NO_HANDLE = float(len(KINDS))
_GRAZING = 0.05  # metres before the camera along the wall's normal, for a meaningful projection


class Target(NamedTuple):
    """The door in a view of a wall; cells are counted from the middle of the first one.

    Attributes
    ----------
    door
        1 where the view shows the wall of a door, else 0.
    left, right
        Columns of the upright edges of the frame, or wall, around it; NaN where they are not seen.
    panel_left, panel_right
        Of the panel's own; NaN also where the frame hides them.
    top
        Its row.
    handle_row, handle_column
        Of the handle's middle.
    kind
        Of the handle: an index of ``KINDS``, or ``NO_HANDLE``.
    """

    door: float
    left: float = np.nan
    right: float = np.nan
    panel_left: float = np.nan
    panel_right: float = np.nan
    top: float = np.nan
    handle_row: float = np.nan
    handle_column: float = np.nan
    kind: float = np.nan

    def shifted(self, columns: float) -> Target:
        """Return the target in a window that begins so many columns further right."""
        return self._replace(
            left=self.left - columns,
            right=self.right - columns,
            panel_left=self.panel_left - columns,
            panel_right=self.panel_right - columns,
            handle_column=self.handle_column - columns,
        )

    def stretched(self, factor: float) -> Target:
        """Return the target in a view whose cells are as many times narrower."""
        half = 0.5 * (factor - 1.0)
        names = (*EDGE_NAMES, "handle_column")
        return self._replace(**{name: factor * getattr(self, name) + half for name in names})

    def lifted(self, rows: int) -> Target:
        """Return the target in a view that begins so many rows lower."""
        return self._replace(top=self.top - rows, handle_row=self.handle_row - rows)

    def mirrored(self, columns: int) -> Target:
        """Return the target in the mirrored view of so many columns."""
        last = columns - 1
        return self._replace(
            left=last - self.right,
            right=last - self.left,
            panel_left=last - self.panel_right,
            panel_right=last - self.panel_left,
            handle_column=last - self.handle_column,
        )


def target_of(view: WallView, room: Room, images: Images, settings: TargetSettings) -> Target:
    """Return what a view of a rendered room shows, as the camera projects it onto the wall."""
    door = room.door
    if door is None or not _is_shown(view, door, settings):
        return Target(0.0)
    columns = {}
    for prefix, corners, seen in (
        ("", door.opening, seen_opening(door, room, images.bodies)),
        ("panel_", door.corners, seen_panel_edges(door, room, images.bodies)),
    ):
        for side in ("left", "right"):
            edge = np.mean([corners[name] for name in EDGES[side]], axis=0)
            is_seen = seen[side] >= settings.seen.edge
            columns[prefix + side] = _cell(view, edge)[1] if is_seen else np.nan
    top = np.nan
    if seen_edges(door, room, images.bodies)["top"] >= settings.seen.top:
        # That of a recessed door is its frame's or its panel's: between both.
        ends = [at[name] for at in (door.corners, door.opening) for name in EDGES["top"]]
        top = float(np.mean([_cell(view, end)[0] for end in ends]))
    if door.handle_centre is None:
        return Target(1.0, **columns, top=top, kind=NO_HANDLE)
    row, column = _cell(view, door.handle_centre)
    kind = float(KINDS.index(door.handle))
    return Target(1.0, **columns, top=top, handle_row=row, handle_column=column, kind=kind)


def _is_shown(view: WallView, door: Door, settings: TargetSettings) -> bool:
    """Tell whether a view's plane is about the door's own."""
    normal, corner = view.frame.normal, door.corners
    middle = np.mean(list(corner.values()), axis=0)
    along = corner["bottom_right"] - corner["bottom_left"]
    near = abs(middle @ normal + view.frame.distance) <= settings.max_distance
    return bool(near and abs(along @ normal) <= settings.max_turn * np.linalg.norm(along))


def _cell(view: WallView, point: NDArray[np.float64]) -> tuple[float, float]:
    """Return row and column of the cells in which a point (3,) of the optical frame is seen."""
    frame = view.frame
    ahead = -float(point @ frame.normal)
    if ahead < _GRAZING:
        return np.nan, np.nan
    on_wall = point * (frame.distance / ahead)
    pixel = float(view.s[1] - view.s[0])
    first, second = height_of(view, np.array([0.0, 1.0]))
    row = (on_wall @ frame.up + frame.height - first) / (second - first)
    column = cell_of(view, (float(on_wall @ frame.right) - float(view.s[0])) / pixel)
    return float(row), column
