"""How much of an object lies inside a sensor's image."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from kmn_perception.model.camera import Camera
from kmn_perception.model.rendering import render

CORNERS = np.array(np.meshgrid(*[[-0.5, 0.5]] * 3)).reshape(3, 8)
REACH = 4.0  # images; the view is unlimited but for what lies farther beside the sensor's image


def visible_fraction(
    unit_cubes: NDArray[np.float64], camera: Camera, axes: NDArray[np.int64] | None = None
) -> float:
    """Return the share of an object's silhouette that lies inside the image, in pixels.

    Parameters
    ----------
    unit_cubes
        (B, 4, 4) maps of the unit cube to the world, as from ``KinematicModel.unit_cubes``.
    axes
        (B,) as ``KinematicModel.cylinder_axes``; without them, all bodies are cuboids.
    """
    left, right, top, bottom = _beyond_the_image(unit_cubes, camera)
    if not (left or right or top or bottom):
        return 1.0
    enlarged = replace(
        camera,
        width=left + camera.width + right,
        height=top + camera.height + bottom,
        cx=camera.cx + left,
        cy=camera.cy + top,
    )
    silhouette = np.isfinite(render(unit_cubes, enlarged, axes))
    inside = silhouette[top : top + camera.height, left : left + camera.width]
    return float(inside.sum() / silhouette.sum())


def _beyond_the_image(unit_cubes: NDArray[np.float64], camera: Camera) -> tuple[int, int, int, int]:
    """Return how far the cubes reach beyond the image: left, right, up, down, in pixels."""
    corners = unit_cubes[:, :3, :3] @ CORNERS + unit_cubes[:, :3, 3:]
    u, v, z = np.moveaxis(camera.project(corners.transpose(0, 2, 1)), -1, 0)
    limit = int(REACH * camera.width), int(REACH * camera.height)
    if z.min() <= camera.near:
        return limit[0], limit[0], limit[1], limit[1]
    beyond = -u.min(), u.max() - (camera.width - 1), -v.min(), v.max() - (camera.height - 1)
    return (
        _pixels(beyond[0], limit[0]),
        _pixels(beyond[1], limit[0]),
        _pixels(beyond[2], limit[1]),
        _pixels(beyond[3], limit[1]),
    )


def _pixels(distance: float, limit: int) -> int:
    return min(max(0, int(np.ceil(distance))), limit)
