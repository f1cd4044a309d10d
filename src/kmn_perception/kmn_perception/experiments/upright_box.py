"""Boxes that stand upright: their overlap, and their differences up to their symmetry."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

QUARTER = np.pi / 2.0


@dataclass(frozen=True, eq=False)
class UprightBox:
    """A cuboid with level top and bottom.

    Attributes
    ----------
    centre
        (3,) metres.
    size
        (3,) along its own axes, metres.
    yaw
        Radians from the world's x axis to its own.
    """

    centre: NDArray[np.float64]
    size: NDArray[np.float64]
    yaw: float

    @property
    def unit_cube(self) -> NDArray[np.float64]:
        """(4, 4) map of the unit cube [-0.5, 0.5]^3 to the world."""
        cos, sin = np.cos(self.yaw), np.sin(self.yaw)
        cube = np.eye(4)
        cube[:3, :3] = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]]) * self.size
        cube[:3, 3] = self.centre
        return cube

    @property
    def footprint(self) -> NDArray[np.float64]:
        """(4, 2) corners of the rectangle that it covers."""
        corners = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])
        return corners @ self.unit_cube[:2, :2].T + self.centre[:2]

    def turned(self, quarters: int) -> UprightBox:
        """Return the same box, described with its axes turned by so many quarters."""
        size = self.size[[1, 0, 2]] if quarters % 2 else self.size
        return UprightBox(self.centre, size, self.yaw + quarters * QUARTER)

    def as_near(self, other: UprightBox) -> UprightBox:
        """Return the same box, described with its axes as near as they can be to another's."""
        return self.turned(round((other.yaw - self.yaw) / QUARTER))


def box_of_cube(unit_cube: NDArray[np.float64]) -> UprightBox:
    """Return the box of a map (4, 4) of the unit cube to the world, which stands upright."""
    axes = unit_cube[:3, :3]
    yaw = float(np.arctan2(axes[1, 0], axes[0, 0]))
    return UprightBox(unit_cube[:3, 3], np.linalg.norm(axes, axis=0), yaw)


class BoxErrors(NamedTuple):
    """By what a box differs from its reference: radians, metres (3,), and the centres' distance."""

    yaw: float
    size: NDArray[np.float64]
    centre: float


def errors(box: UprightBox, reference: UprightBox) -> BoxErrors:
    """Return the absolute errors of a box, along the axes of its reference."""
    same = box.as_near(reference)
    return BoxErrors(
        yaw=abs(same.yaw - reference.yaw),
        size=np.abs(same.size - reference.size),
        centre=float(np.linalg.norm(same.centre - reference.centre)),
    )


def intersection_over_union(a: UprightBox, b: UprightBox) -> float:
    """Return the common volume of two boxes as part of all that they fill."""
    top = min(a.centre[2] + a.size[2] / 2.0, b.centre[2] + b.size[2] / 2.0)
    bottom = max(a.centre[2] - a.size[2] / 2.0, b.centre[2] - b.size[2] / 2.0)
    common = _common_area(a, b) * max(0.0, top - bottom)
    return float(common / (np.prod(a.size) + np.prod(b.size) - common))


def _common_area(a: UprightBox, b: UprightBox) -> float:
    """Return the area that both footprints cover (Sutherland and Hodgman, 1974)."""
    polygon = _clip(a.footprint - b.centre[:2], b)
    x, y = polygon.T
    return float(abs(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2.0)


def _clip(polygon: NDArray[np.float64], box: UprightBox) -> NDArray[np.float64]:
    """Cut a polygon (N, 2) about the centre of a box by the sides of its footprint."""
    cos, sin = np.cos(box.yaw), np.sin(box.yaw)
    for axis, size in zip(((cos, sin), (-sin, cos)), box.size, strict=False):
        for sign in (1.0, -1.0):
            beyond = sign * (polygon @ np.array(axis)) - size / 2.0
            kept = []
            for i in range(len(polygon)):
                before, now = beyond[i - 1], beyond[i]
                if (before > 0.0) != (now > 0.0):
                    along = before / (before - now)
                    kept.append(polygon[i - 1] + along * (polygon[i] - polygon[i - 1]))
                if now <= 0.0:
                    kept.append(polygon[i])
            polygon = np.reshape(kept, (-1, 2))
    return polygon
