"""Algorithm 1 with networks whose answer is known."""

from itertools import islice

import numpy as np
import pytest
import torch
from numpy.typing import NDArray

from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.model.observation import Observation
from kmn_perception.model.rendering import depth_to_cloud, render
from kmn_perception.network.cascade import Cascade
from kmn_perception.network.cascade_settings import CascadeSettings
from kmn_perception.network.morph import predict, predictions
from kmn_perception.network.morph_network import MorphNetwork
from kmn_perception.network.paper_network import PaperNetwork


def constant_paper_network(model: KinematicModel, answer: list) -> PaperNetwork:
    """Return a network that answers the same (theta, gamma) to every image."""
    network = PaperNetwork(model, [1, 1, 1, 1, 1])
    with torch.no_grad():
        network.linear.weight.zero_()
        network.linear.bias.copy_(network.encoding.encode(torch.tensor([answer]))[0])
    return network


def constant_cascade(model: KinematicModel, answers: list) -> Cascade:
    """Return a cascade whose stages answer one after the other."""
    network = Cascade(model, CascadeSettings.load(), len(answers))
    with torch.no_grad():
        for step, answer in enumerate(answers):
            stage = network.stage(step)
            last = stage.head[2]
            assert isinstance(last, torch.nn.Linear)
            last.weight.zero_()
            last.bias.copy_(stage.encoding.encode(torch.tensor([answer]))[0])
    return network


def observe(model: KinematicModel, values: np.ndarray) -> Observation:
    depth = render(model.unit_cubes(*model.split(values)), model.camera)
    return Observation(depth_to_cloud(depth, model.camera), model.camera)


def test_predictions_are_concatenated() -> None:
    """T = T_bar T_bar T_bar: a turn of 0.1 rad and a step of 0.1 m, three times."""
    model = KinematicModel.load("box_b")
    network = constant_paper_network(model, [0.1, 0.0, 0.1])
    prediction, iterations = predict(network, [observe(model, np.zeros(3))], steps=3)
    turns = np.array([0.0, 0.1, 0.2])
    expected = [0.1 * np.cos(turns).sum(), 0.1 * np.sin(turns).sum(), 0.3]
    np.testing.assert_allclose(prediction.values[0], expected, atol=1e-6)
    assert iterations == 3


def test_the_papers_gamma_is_that_of_the_last_prediction() -> None:
    model = KinematicModel.load("door")
    answer = [0.0, 0.0, 0.0, 0.1, -0.1, 0.02, 0.05]
    network = constant_paper_network(model, answer)
    prediction, _ = predict(network, [observe(model, np.zeros(7))], steps=4)
    np.testing.assert_allclose(prediction.values[0], answer, atol=1e-6)


def test_a_cascade_adds_up_gamma_and_ends_after_its_stages() -> None:
    model = KinematicModel.load("door")
    answers = [[0.0, 0.0, 0.0, 0.1, -0.1, 0.02, 0.05], [0.1, 0.0, 0.0, -0.2, 0.05, 0.0, 0.01]]
    network = constant_cascade(model, answers)
    prediction, iterations = predict(network, [observe(model, np.zeros(7))], steps=5)
    np.testing.assert_allclose(prediction.values[0], np.sum(answers, axis=0), atol=1e-6)
    assert iterations == 2


def test_it_stops_when_the_prediction_is_near_the_identity() -> None:
    model = KinematicModel.load("box_a")
    network = constant_paper_network(model, [0.001, 0.0])
    _, iterations = predict(network, [observe(model, np.zeros(2))], steps=5, tolerance=0.002)
    assert iterations == 1


def test_a_right_prediction_shows_the_prototype() -> None:
    """After the true theta, the depth image is that of the prototype (Equation 1)."""
    model = KinematicModel.load("box_a")
    truth = np.array([0.2, -0.1])
    network = constant_paper_network(model, truth.tolist())
    observation = observe(model, truth)
    values = next(predictions(network, [observation])).values
    (morphed,) = network.render_anew(1, [observation], values)
    (prototype,) = network.render_anew(0, [observe(model, 0.0 * truth)], np.zeros((1, 2)))
    seen = (morphed > 0.0) & (prototype > 0.0)
    assert seen.sum() > 0.7 * (prototype > 0.0).sum()
    np.testing.assert_allclose(np.median(morphed[seen] - prototype[seen]), 0.0, atol=2e-3)


@pytest.mark.parametrize(
    ("name", "expected"), [("box_b", [0, 0, 0]), ("box", [0.3, -0.2, 0, 0, 0, 0])]
)
def test_the_paper_starts_at_the_prototype_or_above_the_centroid(name: str, expected: list) -> None:
    model = KinematicModel.load(name)
    points = np.array([[0.2, -0.3, 0.1], [0.4, -0.1, 0.2]], dtype=np.float32)
    network = constant_paper_network(model, [0.0] * len(model.parameters))
    start = network.start([Observation(points, model.camera)])
    np.testing.assert_allclose(start, [expected], atol=1e-6)


@pytest.mark.parametrize("name", ["box_a", "box_c", "door"])
def test_a_cascade_starts_where_the_points_are(name: str) -> None:
    """For points of the prototype, moved without being seen anew, this is the whole motion."""
    model = KinematicModel.load(name)
    network = Cascade(model, CascadeSettings.load(), stages=0)
    prototype = observe(model, np.zeros(len(model.parameters)))
    moved = Observation(
        prototype.points + np.array([0.2, -0.1, 0.0], dtype=np.float32), model.camera
    )
    expected = np.zeros((2, len(model.parameters)))
    expected[1, :2] = 0.2, -0.1
    np.testing.assert_allclose(network.start([prototype, moved]), expected, atol=1e-5)


@pytest.mark.parametrize("name", ["box_b", "box_c", "door", "box"])
def test_a_network_undoes_what_it_leaves(name: str) -> None:
    """What is left to predict, predicted, gives the truth."""
    model = KinematicModel.load(name)
    generator = np.random.default_rng(0)
    values, truth = model.sample(generator, 50), model.sample(generator, 50)
    networks: list[MorphNetwork] = [
        constant_paper_network(model, [0.0] * len(model.parameters)),
        Cascade(model, CascadeSettings.load(), stages=0),
    ]
    for network in networks:
        left = network.remainder(values, truth)
        np.testing.assert_allclose(network.concatenate(values, left), truth, atol=1e-9)


def test_observations_are_predicted_together_as_alone() -> None:
    model = KinematicModel.load("door")
    torch.manual_seed(0)
    network = Cascade(model, CascadeSettings.load(), stages=2).eval()
    truths = model.sample(np.random.default_rng(1), 3) * 0.3
    seen = [observe(model, truth) for truth in truths]
    together = list(islice(predictions(network, seen), 2))[-1].values
    for observation, values in zip(seen, together, strict=True):
        alone, _ = predict(network, [observation], steps=2)
        np.testing.assert_allclose(alone.values[0], values, atol=1e-5)


@pytest.mark.parametrize("name", ["box_c", "door", "box"])
@pytest.mark.parametrize("factor", [-100.0, 100.0])
def test_a_cascade_that_diverges_still_has_bodies_with_a_size(name: str, factor: float) -> None:
    model = KinematicModel.load(name)
    network = Cascade(model, CascadeSettings.load(), stages=0)
    values: NDArray[np.float64] = np.zeros((1, len(model.parameters)))
    for _ in range(3):
        values = network.concatenate(values, factor * np.abs(model.limits[None, :, 1]))
    cubes = model.unit_cubes(*model.split(values[0]))
    assert np.linalg.det(cubes[:, :3, :3]).min() > 0.0
