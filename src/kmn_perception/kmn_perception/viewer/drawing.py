"""Draws into the scene of the page; what has not changed is not sent again."""

from __future__ import annotations

from typing import Any

import numpy as np
import viser
from matplotlib.colors import to_rgb
from numpy.typing import NDArray

from kmn_perception.model.rotation import quaternion_from_matrix
from kmn_perception.viewer.shapes import Axes, Cubes, edges, triangles

Rgb = tuple[int, int, int]
UPRIGHT = (1.0, 0.0, 0.0, 0.0)  # the quaternion w, x, y, z that turns nothing


def colour(name: str) -> Rgb:
    """Return the colour of a name or code of matplotlib, 0 to 255."""
    red, green, blue = (round(255.0 * part) for part in to_rgb(name))
    return red, green, blue


def wxyz(rotation: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the quaternion w, x, y, z of a rotation (3, 3)."""
    return np.roll(quaternion_from_matrix(rotation), 1)


def plain(text: str) -> str:
    """Return a text for Markdown, in which nothing of it is taken for markup or code."""
    return "".join(c if c.isalnum() or c in " .,-+" else f"&#{ord(c)};" for c in text)


class Drawing:
    """Named nodes below one node of the scene."""

    def __init__(self, scene: viser.SceneApi, root: str) -> None:
        self._scene, self._root = scene, root
        self._nodes: dict[str, Any] = {}
        self._drawn: dict[str, tuple[Any, ...]] = {}

    def bodies(
        self,
        name: str,
        cubes: Cubes,
        axes: Axes,
        paint: Rgb,
        opacity: float,
        line: float = 0.006,
    ) -> None:
        """Draw cuboids (B, 4, 4), those with axes (B,) as cylinders, with their edges.

        Parameters
        ----------
        line
            Width of the edges, metres.
        """
        if self._is_drawn(name, cubes, axes.tolist(), paint, opacity):
            return
        vertices, faces = triangles(cubes, axes)
        self._nodes[name] = self._scene.add_mesh_simple(
            f"{self._root}/{name}",
            vertices.astype(np.float32),
            faces.astype(np.uint32),
            color=paint,
            opacity=opacity,
            flat_shading=True,
            side="double",
            cast_shadow=False,
            receive_shadow=False,
        )
        self._scene.add_line_segments(  # goes with what it is below
            f"{self._root}/{name}/edges",
            edges(cubes, axes).astype(np.float32),
            paint,
            thickness=line,
        )

    def label(self, name: str, text: str, place: NDArray[np.float64]) -> None:
        """Write a text at a place (3,)."""
        if not self._is_drawn(name, place, text):
            self._nodes[name] = self._scene.add_label(
                f"{self._root}/{name}", text, position=place, anchor="bottom-center"
            )

    def keep(self, names: set[str]) -> None:
        """Remove all but some nodes."""
        for name in set(self._nodes) - names:
            del self._drawn[name]
            self._nodes.pop(name).remove()

    def _is_drawn(self, name: str, array: NDArray[np.float64], *rest: Any) -> bool:
        """Tell whether this is what is drawn under a name; else note that it will be."""
        before = self._drawn.get(name)
        if before is not None and before[1:] == rest and np.array_equal(before[0], array):
            return True
        self._drawn[name] = (array.copy(), *rest)
        return False
