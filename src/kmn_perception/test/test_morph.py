"""Algorithm 1 with a network whose answer is known."""

import numpy as np
import pytest
import torch

from kmn_perception.kinematic_model import KinematicModel
from kmn_perception.morph import predict, predictions, start
from kmn_perception.network import MorphNetwork
from kmn_perception.rendering import depth_to_cloud, render


class Constant(MorphNetwork):
    """A network that answers the same (theta, gamma) to every image."""

    def __init__(self, model: KinematicModel, answer: list) -> None:
        super().__init__(model, [1, 1, 1, 1, 1])
        with torch.no_grad():
            self.linear.weight.zero_()
            self.linear.bias.copy_(self.encoding.encode(torch.tensor([answer]))[0])


def cloud_of(model: KinematicModel, values: np.ndarray) -> np.ndarray:
    return depth_to_cloud(
        render(model.unit_cubes(*model.split(values)), model.camera), model.camera
    )


def test_predictions_are_concatenated() -> None:
    """T = T_bar T_bar T_bar: a turn of 0.1 rad and a step of 0.1 m, three times."""
    model = KinematicModel.load("box_b")
    network = Constant(model, [0.1, 0.0, 0.1])
    cloud = cloud_of(model, np.zeros(3))
    prediction, iterations = predict(model, network, [cloud], np.zeros((1, 3)), steps=3)
    turns = np.array([0.0, 0.1, 0.2])
    expected = [0.1 * np.cos(turns).sum(), 0.1 * np.sin(turns).sum(), 0.3]
    np.testing.assert_allclose(prediction.values[0], expected, atol=1e-6)
    assert iterations == 3


def test_gamma_is_that_of_the_last_prediction() -> None:
    model = KinematicModel.load("door")
    answer = [0.0, 0.0, 0.0, 0.1, -0.1, 0.02, 0.05]
    cloud = cloud_of(model, np.zeros(7))
    prediction, _ = predict(model, Constant(model, answer), [cloud], np.zeros((1, 3)), steps=4)
    np.testing.assert_allclose(prediction.values[0], answer, atol=1e-6)


def test_it_stops_when_the_prediction_is_near_the_identity() -> None:
    model = KinematicModel.load("box_a")
    network = Constant(model, [0.001, 0.0])
    cloud = cloud_of(model, np.zeros(2))
    _, iterations = predict(model, network, [cloud], np.zeros((1, 2)), steps=5, tolerance=0.002)
    assert iterations == 1


def test_a_right_prediction_shows_the_prototype() -> None:
    """After the true theta, the depth image is that of the prototype (Equation 1)."""
    model = KinematicModel.load("box_a")
    truth = np.array([0.2, -0.1])
    state = next(
        predictions(
            model, Constant(model, truth.tolist()), [cloud_of(model, truth)], np.zeros((1, 2))
        )
    )
    prototype = next(
        predictions(
            model, Constant(model, [0.0, 0.0]), [cloud_of(model, 0 * truth)], np.zeros((1, 2))
        )
    )
    seen = (state.depth > 0.0) & (prototype.depth > 0.0)
    assert seen.sum() > 0.7 * (prototype.depth > 0.0).sum()
    np.testing.assert_allclose(np.median(state.depth[seen] - prototype.depth[seen]), 0.0, atol=2e-3)


@pytest.mark.parametrize(
    ("name", "expected"), [("box_b", [0, 0, 0]), ("box", [0.3, -0.2, 0, 0, 0, 0])]
)
def test_it_starts_at_the_prototype_or_above_the_centroid(name: str, expected: list) -> None:
    cloud = np.array([[0.2, -0.3, 0.1], [0.4, -0.1, 0.2]], dtype=np.float32)
    np.testing.assert_allclose(start(KinematicModel.load(name), [cloud]), [expected], atol=1e-6)
