"""What the search for doors is compared with: single means of it, and the older pipeline."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kmn_perception.doors.lines import Line, Pieces, cut_to_pieces, find_lines
from kmn_perception.doors.settings import DoorSettings
from kmn_perception.doors.wall_view import WallView
from kmn_perception.doors.walls import Frame, NoWallError, find_walls
from kmn_perception.evaluation.doors.errors import DoorPlace

Found = DoorPlace | None


class Wall(NamedTuple):
    """A wall as it is seen squarely, with its columns cut to pieces."""

    view: WallView
    pieces: Pieces


def depth_steps(frame: Frame, settings: DoorSettings) -> Found:
    """Return the strongest pair of steps in depth as of a recess, without any grey."""

    def strength(left: Line, right: Line) -> float:
        return min(left.step, -right.step) - settings.lines.min_step

    return _strongest_pair(frame._replace(grey=None), settings, strength)


def grey_lines(frame: Frame, settings: DoorSettings) -> Found:
    """Return the strongest pair of lines over a door's height in grey, whatever the depth is."""

    def strength(left: Line, right: Line) -> float:
        if min(left.coverage, right.coverage) < settings.verdict.min_coverage:
            return 0.0
        return min(left.contrast, right.contrast)

    return _strongest_pair(frame, settings, strength)


def _strongest_pair(
    frame: Frame, settings: DoorSettings, strength: Callable[[Line, Line], float]
) -> Found:
    """Return the pair of lines as far apart as a door's whose strength is largest, and positive."""
    best, found = 0.0, None
    for view, pieces in _walls(frame, settings):
        pixel = float(view.s[1] - view.s[0])
        for left, right in combinations(find_lines(pieces, settings.lines), 2):
            width = (right.column - left.column) * pixel
            low, high = settings.verdict.width
            if low <= width <= high and (value := strength(left, right)) > best:
                best, found = value, _place(view, left, right)
    return found


def _walls(frame: Frame, settings: DoorSettings) -> Iterator[Wall]:
    """Yield the walls in view."""
    noise = settings.fit.pixel_noise
    try:
        walls = find_walls(frame, settings, np.random.default_rng(0))
    except NoWallError:
        return
    for view in walls.views(frame, settings):
        before, behind = settings.view.before * noise, settings.view.behind * noise
        yield Wall(view, cut_to_pieces(view, before, behind, settings.lines))


def _place(view: WallView, left: Line, right: Line) -> DoorPlace:
    """Return the door between two lines of a wall, from the floor to the height of the wall."""
    z = np.array([float(view.z.max()), 0.0])

    def edge(line: Line) -> NDArray[np.float64]:
        return view.frame.points(np.full(2, view.s[line.column]), z)

    width = float(view.s[right.column] - view.s[left.column])
    return DoorPlace(edge(left), edge(right), view.frame.normal, width)


BASELINES = {"depth_steps": depth_steps, "grey_lines": grey_lines}
