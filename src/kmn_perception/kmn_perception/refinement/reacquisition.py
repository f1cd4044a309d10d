"""Finding a small body, such as a handle, where the coarse search has lost it."""

from __future__ import annotations

import itertools

import numpy as np
from numba import njit
from numpy.typing import NDArray

from kmn_perception.refinement.geometry import Shape, cuboids
from kmn_perception.refinement.image import InverseDepthImage, may_hide
from kmn_perception.refinement.view import ModelView, model_view, raycast, raycast_any


def reacquire(
    shape: Shape,
    image: InverseDepthImage,
    limits: NDArray[np.float64],
    values: NDArray[np.float64],
    tries: int,
    enough: float,
) -> NDArray[np.float64]:
    """Return the values (P,), with bodies that are not seen in their places moved to better ones.

    Only parameters that move no other body are changed, on a grid over their limits.

    Parameters
    ----------
    tries
        About the size of the grid.
    enough
        A body is in its place when its support is at least this.
    """
    for b, own in enumerate(_own_parameters(shape, values)):
        if not own:
            continue
        best = support(model_view(shape, values, image.projection), image, b)
        if best >= enough:
            continue
        start, count = values, max(2, int(tries ** (1.0 / len(own))))
        axes = [np.linspace(limits[i, 0], limits[i, 1], count) for i in own]
        for place in itertools.product(*axes):
            candidate = start.copy()
            candidate[own] = place
            found = support(model_view(shape, candidate, image.projection), image, b)
            if found > best:
                values, best = candidate, found
    return values


def _own_parameters(shape: Shape, values: NDArray[np.float64]) -> list[list[int]]:
    """Return, for each of several bodies, the parameters that move no other."""
    _, slopes = cuboids(shape, values)
    moves = np.abs(slopes).max(axis=(1, 2)) > 0.0  # (B, P)
    if len(moves) == 1:
        return [[]]
    return [list(np.flatnonzero(moved & (moves.sum(axis=0) == 1))) for moved in moves]


@njit(cache=True, error_model="numpy")
def support(view: ModelView, image: InverseDepthImage, body: int) -> float:
    """Return the part of a body's visible pixels that show it, less the part that do not.

    A pixel shows the body when its depth is nearer to the body's than to that of what the model has
    behind it. A body that is out of view has full support.
    """
    solids, inverse_depth, interpolated = view.solids, image.inverse_depth, image.interpolated
    height, width = inverse_depth.shape
    first = max(0, int(np.ceil(max(solids[body, 0], 0.0))))
    last = min(width - 1, int(np.floor(min(solids[body, 1], width - 1.0))))
    top = max(0, int(np.ceil(max(solids[body, 2], 0.0))))
    bottom = min(height - 1, int(np.floor(min(solids[body, 3], height - 1.0))))
    count, shown = 0, 0
    for row in range(top, bottom + 1):
        for column in range(first, last + 1):
            u, v = float(column), float(row)
            nearest, met, _ = raycast_any(solids, u, v)
            if met != body or nearest > image.nearest:
                continue
            behind = 0.0
            for other in range(solids.shape[0]):
                if other != body:
                    inverse, _ = raycast(solids, other, u, v)
                    behind = max(behind, inverse)
            seen = float(inverse_depth[row, column])
            if seen <= 0.0 and may_hide(seen, interpolated[row, column], nearest):
                continue
            count += 1
            if 0.5 * (nearest + behind) < seen < 1.5 * nearest - 0.5 * behind:
                shown += 1
    return 2.0 * shown / count - 1.0 if count > 0 else 1.0
