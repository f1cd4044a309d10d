"""Objects that the image truncates, where the sensor does not measure at its border."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from kmn_perception.model.rendering import render
from kmn_perception.pipeline import MorphPipeline
from kmn_perception.scene.depth_view import DepthView

from .conftest import shipped_pipeline

THETA, GAMMA = [-0.75, 0.0, 0.0], [0.1, 0.0, 0.0, -0.05]  # the door's top is out of view
HEIGHT = 3  # column of the door's height among the parameters


@cache
def pipeline() -> MorphPipeline:
    return shipped_pipeline()


@pytest.mark.parametrize("rows", [0, 1, 3, 8])
def test_rows_without_measurements_do_not_hide_that_the_top_is_out_of_view(rows: int) -> None:
    model = pipeline().model
    depth = render(model.unit_cubes(THETA, GAMMA), model.camera)
    depth[:rows] = np.nan
    (found,) = pipeline().estimate_all(DepthView.of_depth(depth, model.camera), 1)
    assert found.truncated
    deviation = np.sqrt(np.diag(found.estimate.covariance))
    assert deviation[HEIGHT] > 0.01
    error = np.abs(np.concatenate([found.estimate.theta, found.estimate.gamma]) - [*THETA, *GAMMA])
    assert (error < np.maximum(4.0 * deviation, 1e-3)).all()


def test_a_door_wholly_in_view_is_not_truncated_by_rows_without_measurements() -> None:
    model = pipeline().model
    depth = render(model.unit_cubes([0.3, 0.0, 0.2], [0.0] * 4), model.camera)
    depth[:3] = depth[-3:] = np.nan
    (found,) = pipeline().estimate_all(DepthView.of_depth(depth, model.camera), 1)
    assert not found.truncated
    assert np.sqrt(found.estimate.covariance[HEIGHT, HEIGHT]) < 0.002
