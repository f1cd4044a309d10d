"""What no method could know: the parameters that an image does not show."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from kmn_perception.evaluation.observability import unobservable_directions
from kmn_perception.model.camera import Camera
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.model.rendering import render

SAME_DEPTH = 1e-5  # metres; above the rounding of single precision
PRECISION = 1e-3  # of the interval that the limits leave along a direction
PASSES = 2  # the middle along one unobservable direction can shift that along another


def best_estimate(
    model: KinematicModel, camera: Camera, truth: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the middle (n + m,) of all parameters that look the same as the truth.

    This is the best possible estimate: of all parameters within the limits that look the same, it
    has the minimum expected absolute error. Hidden is what an exact and complete depth image does
    not show, because it is outside the image or behind other bodies; not what holes and noise hide.
    """
    image = render(model.unit_cubes(*model.split(truth)), camera)
    directions = unobservable_directions(model, camera, truth, image)
    middle = truth.copy()
    for _ in range(PASSES if len(directions) > 1 else 1):
        for direction in directions:
            ends = [_reach(model, camera, image, middle, sign * direction) for sign in (1.0, -1.0)]
            middle += (ends[0] - ends[1]) / 2.0 * direction
    return middle


def _reach(
    model: KinematicModel,
    camera: Camera,
    image: NDArray[np.float32],
    start: NDArray[np.float64],
    direction: NDArray[np.float64],
) -> float:
    """Return the maximum multiple of a direction, within the limits, that looks the same."""
    low, high = model.limits.T
    moving = direction != 0.0
    ahead = np.where(direction > 0.0, high, low)
    max_reach = float(((ahead - start)[moving] / direction[moving]).min())

    def looks_same(reach: float) -> bool:
        cubes = model.unit_cubes(*model.split(start + reach * direction))
        return _same(image, render(cubes, camera))

    if looks_same(max_reach):
        return max_reach
    same, different = 0.0, max_reach
    while different - same > PRECISION * max_reach:
        middle = (same + different) / 2.0
        if looks_same(middle):
            same = middle
        else:
            different = middle
    return same


def _same(first: NDArray[np.float32], second: NDArray[np.float32]) -> bool:
    both = np.isfinite(first)
    return np.array_equal(both, np.isfinite(second)) and bool(
        (np.abs(first[both] - second[both]) <= SAME_DEPTH).all()
    )
