"""The best and the worst samples, before and after morphing (the paper's figure)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from kmn_perception.evaluation.plots.style import figure
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.model.observation import Observation
from kmn_perception.model.point_rendering import point_cloud_to_depth
from kmn_perception.model.rendering import render

PANEL = 2.3, 1.9  # inches
WIDTH, HEIGHT = 320, 240  # pixels of the images that are drawn
GAP = 3  # holes of up to so many pixels are closed


class Shown(NamedTuple):
    """A sample to show: what was seen, the estimate (n + m,), and what to write above it."""

    observation: Observation
    values: NDArray[np.float64]
    title: str


def draw_samples(model: KinematicModel, samples: Sequence[Shown], file: Path) -> None:
    """Draw what the canonical camera sees of the points, as observed and morphed by T^-1.

    The contour is the prototype's, after morphing with the estimated gamma.
    """
    with figure(file, 2, len(samples), PANEL) as made:
        grid = made.subplots(2, len(samples), squeeze=False)
        grid[0, 0].set_ylabel("observed")
        grid[1, 0].set_ylabel("morphed")
        for (above, below), (observation, values, title) in zip(grid.T, samples, strict=True):
            theta, gamma = model.split(values)
            above.set_title(title)
            _draw(above, model, observation, np.zeros_like(theta), np.zeros_like(gamma))
            _draw(below, model, observation, theta, gamma)


def _draw(
    axes: Axes,
    model: KinematicModel,
    observation: Observation,
    theta: NDArray[np.float64],
    gamma: NDArray[np.float64],
) -> None:
    drawn = replace(
        model,
        input=replace(model.depth_image, width=WIDTH, height=HEIGHT, supersampling=1, max_gap=GAP),
    )
    inverse = model.transformation.inverse(theta)
    depth = point_cloud_to_depth(drawn, observation.points, inverse)
    axes.imshow(np.where(depth > 0.0, depth, np.nan), cmap="viridis")
    cubes, camera = (
        model.unit_cubes(np.zeros_like(theta), gamma),
        model.camera.resized(WIDTH, HEIGHT),
    )
    for body in range(len(cubes)):
        alone = slice(body, body + 1)
        silhouette = render(cubes[alone], camera, model.cylinder_axes[alone])
        axes.contour(np.isfinite(silhouette), levels=[0.5], colors="#d01c1c", linewidths=0.9)
    axes.set(xticks=[], yticks=[], facecolor="#f2f2f2")
    axes.grid(False)
    axes.spines[:].set_visible(False)
