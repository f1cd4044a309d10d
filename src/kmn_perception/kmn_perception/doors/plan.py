"""Wall, frame and panel as seen from above."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

OUTWARD = {"left": -1.0, "right": 1.0}


@dataclass(frozen=True, eq=False)
class Plan:
    """Wall and panel as seen from above, as lines b x + c y = 1: x to the right, y away.

    Attributes
    ----------
    wall, panel
        (2,) their lines.
    proud
        By how much the frame stands out of the wall, metres.
    hinge
        ``left`` or ``right`` of an open panel; empty if it is closed.
    """

    wall: NDArray[np.float64]
    panel: NDArray[np.float64]
    proud: float
    hinge: str

    @cached_property
    def away(self) -> NDArray[np.float64]:
        """(2,) the wall's normal, away from the camera."""
        unit: NDArray[np.float64] = self.wall / math.hypot(*self.wall)
        return unit

    @cached_property
    def distance(self) -> float:
        """Of the camera from the frame's front, metres."""
        return 1.0 / math.hypot(*self.wall) - self.proud

    @cached_property
    def along(self) -> NDArray[np.float64]:
        """(2,) along the wall, to the right."""
        return _along(self.wall)

    def behind(self, point: NDArray[np.float64]) -> float:
        """Return how far behind the frame's front a point (2,) is, metres."""
        return float(self.away @ point) - self.distance

    def frame_at(self, place: float) -> NDArray[np.float64]:
        """Return the point (2,) of the frame's front at a place along the wall, metres."""
        point: NDArray[np.float64] = self.distance * self.away + place * self.along
        return point

    def panel_at(self, side: str, place: float, hinge_place: float) -> NDArray[np.float64]:
        """Return the point (2,) of the panel's edge whose frame's edge is at a place.

        Parameters
        ----------
        hinge_place
            The place of the hinged edge of an open panel.
        """
        swings = bool(self.hinge) and side != self.hinge
        foot = self.frame_at(hinge_place if swings else place)
        point = foot + self.away * (1.0 - self.panel @ foot) / (self.panel @ self.away)
        if swings:
            point = point + (place - hinge_place) * _along(self.panel)
        return np.asarray(point, dtype=np.float64)

    def place_of_frame(self, direction: float) -> float:
        """Return the place along the wall at which the frame is seen in a direction."""
        ray = np.array([direction, 1.0])
        return float(self.along @ ray) * self.distance / float(self.away @ ray)

    def place_of_panel(self, side: str, direction: float, hinge_place: float) -> float:
        """Return the place along the wall of an edge whose panel is seen in a direction."""
        ray = np.array([direction, 1.0])
        point = ray / float(self.panel @ ray)
        if not self.hinge or side == self.hinge:
            return float(self.along @ point)
        hinge = self.panel_at(self.hinge, hinge_place, hinge_place)
        return hinge_place + float(_along(self.panel) @ (point - hinge))


def _along(line: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the direction (2,) along a line (b, c), to the right."""
    b, c = line / math.hypot(*line)
    return np.array([c, -b])
