"""Holes all over an image do not part an object: it is found as its unorganised points are."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from kmn_perception.estimate import Status
from kmn_perception.model.rendering import render
from kmn_perception.pipeline import MorphPipeline
from kmn_perception.scene.depth_view import DepthView

from .conftest import shipped_pipeline

VALUES = np.array([0.3, 0.1, 0.4, -0.1, 0.05, 0.01, 0.03])
ACCURACY = 0.01  # metres and radians


@cache
def pipeline() -> MorphPipeline:
    return shipped_pipeline()


def holes(kind: str, shape: tuple[int, ...]) -> NDArray[np.bool_]:
    """Return which pixels (height, width) are not measured."""
    rows, columns = np.indices(shape)
    if kind == "checkerboard":
        return np.asarray((rows + columns) % 2 == 0)
    if kind == "rows":
        return np.asarray(rows % 3 > 0)
    return np.random.default_rng(0).random(shape) < float(kind)


@pytest.mark.parametrize("kind", ["0.4", "0.6", "0.8", "checkerboard", "rows"])
def test_a_door_with_holes_all_over_is_found(kind: str) -> None:
    model = pipeline().model
    depth = render(model.unit_cubes(*model.split(VALUES)), model.camera)
    depth[holes(kind, depth.shape)] = np.nan
    found = pipeline().estimate(DepthView.of_depth(depth, model.camera))
    assert (found.status, found.reason) == (Status.OK, "")
    np.testing.assert_allclose([*found.theta, *found.gamma], VALUES, atol=ACCURACY)
