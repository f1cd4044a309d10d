"""What a view hardly shows: the stated deviation holds the truth all the same."""

from __future__ import annotations

import numpy as np
import pytest

from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.network import weights
from kmn_perception.network.morph import predict
from kmn_perception.refinement import RefinementSettings, refine
from kmn_perception.training.samples import sample
from kmn_perception.training.settings import SensorSettings

AROUND = SensorSettings(
    camera="kinect_v1", distance=(1.8, 3.2), azimuth=(-0.6, 0.6), elevation=(0.05, 0.5),
    noise="kinect", holes=0.0, pose_error=(0.0, 0.0), occlusion=0.0, cut_height=0.0,
)  # fmt: skip
SEED, KEY = 77, (9,)


@pytest.mark.parametrize(
    ("index", "sensor"),
    [
        (3, None),  # the top, from which alone the depth is known, is a few pixels high
        (16, None),
        (33, None),
        (46, None),
        (14, AROUND),  # depth and the bar's height are not one unknown
        (16, AROUND),  # the network puts the top beyond the image, in which it is
    ],
)
def test_a_fridge_is_where_its_covariance_says(index: int, sensor: SensorSettings | None) -> None:
    model = KinematicModel.load("fridge")
    network = weights.load("fridge", model).network
    observation, truth = sample(model, SEED, index, sensor, "kinect", spawn_key=KEY)
    prediction, _ = predict(network, [observation], 5, 0.005)
    fit = refine(model, observation, prediction.values[0], RefinementSettings.load())
    assert not fit.reason
    count = len(truth)  # the angle of its door follows
    error, covariance = fit.values[:count] - truth, fit.covariance[:count, :count]
    assert np.abs(error / np.sqrt(np.diag(covariance))).max() < 4.5
    assert error @ np.linalg.solve(covariance, error) < 35.0  # chi squared of 8, one in 40000


def test_a_top_that_is_in_the_image_is_measured() -> None:
    """Although its edge is not in the model that the network proposes."""
    model = KinematicModel.load("fridge")
    network = weights.load("fridge", model).network
    observation, truth = sample(model, SEED, 16, AROUND, spawn_key=KEY)
    prediction, _ = predict(network, [observation], 5, 0.005)
    height = [parameter.name for parameter in model.parameters].index("height")
    assert abs(prediction.values[0][height] - truth[height]) > 0.2
    fit = refine(model, observation, prediction.values[0], RefinementSettings.load())
    assert abs(fit.values[height] - truth[height]) < 0.005
