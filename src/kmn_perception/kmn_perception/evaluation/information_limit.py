"""What no method could know: the parameters that the image of an observation does not show."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from kmn_perception.evaluation.observability import null_directions
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

    This is the best that can be done: within the limits, no other estimate of what looks the same
    has a smaller expected absolute error. Hidden is what an exact and complete depth image does not
    show, beyond its border or behind other parts, but not what holes and noise hide.
    """
    image = render(model.unit_cubes(*model.split(truth)), camera)
    directions = null_directions(model, camera, truth, image)
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
    """Return how far one can go along a direction within the limits and with the same image."""
    low, high = model.limits.T
    moving = direction != 0.0
    ahead = np.where(direction > 0.0, high, low)
    farthest = float(((ahead - start)[moving] / direction[moving]).min())
    good, bad = 0.0, farthest
    if _same(image, render(model.unit_cubes(*model.split(start + farthest * direction)), camera)):
        return farthest
    while bad - good > PRECISION * farthest:
        middle = (good + bad) / 2.0
        values = start + middle * direction
        if _same(image, render(model.unit_cubes(*model.split(values)), camera)):
            good = middle
        else:
            bad = middle
    return good


def _same(first: NDArray[np.float32], second: NDArray[np.float32]) -> bool:
    both = np.isfinite(first)
    return np.array_equal(both, np.isfinite(second)) and bool(
        (np.abs(first[both] - second[both]) <= SAME_DEPTH).all()
    )
