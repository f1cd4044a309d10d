"""Finding a small body, such as a handle, that the coarse search has lost."""

from __future__ import annotations

import itertools

import numpy as np
from numba import njit
from numpy.typing import NDArray

from kmn_perception.refinement.geometry import Shape, cuboids
from kmn_perception.refinement.image import InverseDepthImage, may_hide
from kmn_perception.refinement.problem import Problem
from kmn_perception.refinement.solids import (
    BOTTOM,
    LEFT,
    RIGHT,
    TOP,
    raycast_any,
    raycast_others,
)
from kmn_perception.refinement.view import ModelView


def reacquire(problem: Problem, values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the values (P,) with bodies moved that the observation does not show in their places.

    Only parameters that move no other body are changed, on a grid within their limits.
    """
    settings, limits = problem.settings.reacquisition, problem.limits
    for body, own in enumerate(_own_parameters(problem.shape, values)):
        if not own:
            continue
        best = support(problem.view(values), problem.image, body)
        if best >= settings.min_support:
            continue
        start, count = values, max(2, int(settings.candidates ** (1.0 / len(own))))
        axes = [np.linspace(limits[i, 0], limits[i, 1], count) for i in own]
        for place in itertools.product(*axes):
            candidate = start.copy()
            candidate[own] = place
            found = support(problem.view(candidate), problem.image, body)
            if found > best:
                values, best = candidate, found
    return values


def _own_parameters(shape: Shape, values: NDArray[np.float64]) -> list[list[int]]:
    """Return, for each of several bodies, the parameters that move no other body."""
    _, jacobians = cuboids(shape, values)
    moves = np.abs(jacobians).max(axis=(1, 2)) > 0.0  # (B, P)
    if len(moves) == 1:
        return [[]]
    return [list(np.flatnonzero(moved & (moves.sum(axis=0) == 1))) for moved in moves]


@njit(cache=True, error_model="numpy")
def support(view: ModelView, image: InverseDepthImage, body: int) -> float:
    """Return the fraction of a body's visible pixels that show it, less that of those that do not.

    A pixel shows the body when its depth is closer to the body's than to that of what the model has
    behind it. A body that is out of view has full support.
    """
    solids, inverse_depth, interpolated = view.solids, image.inverse_depth, image.interpolated
    height, width = inverse_depth.shape
    left = max(0, int(np.ceil(max(solids[body, LEFT], 0.0))))
    right = min(width - 1, int(np.floor(min(solids[body, RIGHT], width - 1.0))))
    top = max(0, int(np.ceil(max(solids[body, TOP], 0.0))))
    bottom = min(height - 1, int(np.floor(min(solids[body, BOTTOM], height - 1.0))))
    count, shown = 0, 0
    for row in range(top, bottom + 1):
        for column in range(left, right + 1):
            u, v = float(column), float(row)
            nearest, entered, _ = raycast_any(solids, u, v)
            if entered != body or nearest > image.nearest:
                continue
            behind = raycast_others(solids, body, u, v)
            seen = float(inverse_depth[row, column])
            if seen <= 0.0 and may_hide(image.occlusion, seen, interpolated[row, column], nearest):
                continue
            count += 1
            if 0.5 * (nearest + behind) < seen < 1.5 * nearest - 0.5 * behind:
                shown += 1
    return 2.0 * shown / count - 1.0 if count > 0 else 1.0
