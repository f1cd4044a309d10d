"""The network and its encoding: the paper's structure, and symmetries without a jump."""

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.network.encoding import ParameterEncoding
from kmn_perception.network.paper_network import PaperNetwork

MODELS = {name: KinematicModel.load(name) for name in ("box_a", "box_b", "box_c", "box", "door")}


def test_number_of_weights_is_that_of_the_paper() -> None:
    """Door: 3x3 convolutions with 2, 4, 8, 16, 32 channels and one linear layer on 4 x 3 pixels.

    The two channels of the depth image add nine weights for each of the first two channels.
    """
    network = PaperNetwork(MODELS["door"], [2, 4, 8, 16, 32])
    channels = [2, 2, 4, 8, 16, 32]
    convolutions = sum(9 * a * b + b for a, b in zip(channels[:-1], channels[1:], strict=True))
    linear = (32 * 4 * 3 + 1) * 7
    assert sum(p.numel() for p in network.parameters()) == convolutions + linear


def test_pooling_before_the_relu_gives_the_same_as_after() -> None:
    """The order of the paper: convolution, ReLU, pooling."""
    network = PaperNetwork(MODELS["box_b"], [2, 4, 6, 8, 10])
    depth = torch.rand(3, 96, 128, generator=torch.Generator().manual_seed(0))
    features = network.split(depth)
    for layer in network.convolutions:
        if isinstance(layer, torch.nn.Conv2d):
            features = torch.max_pool2d(torch.relu(layer(features)), 2)
    torch.testing.assert_close(network(depth), network.linear(features.flatten(1)))


def test_the_split_holds_the_depth_image() -> None:
    network = PaperNetwork(MODELS["door"], [2, 4, 8, 16, 32])
    depth = torch.tensor([[[0.0, 0.004, 0.5, 1.0]]])
    covered, stretched = network.split(depth)[0]
    torch.testing.assert_close(covered, torch.tensor([[0.0, 1.0, 1.0, 1.0]]))
    torch.testing.assert_close(
        covered / 2.0 + stretched / MODELS["door"].depth_image.contrast, depth[0]
    )


@pytest.mark.parametrize("name", MODELS)
def test_decoding_undoes_encoding(name: str) -> None:
    model = MODELS[name]
    values = torch.from_numpy(model.sample(np.random.default_rng(0), 200))
    encoding = ParameterEncoding(model, model.symmetry)
    torch.testing.assert_close(encoding.decode(encoding.encode(values)), values)


@given(st.floats(-0.785, 0.785), st.floats(-0.8, 1.0), st.floats(-0.8, 1.0))
def test_a_quarter_turned_box_is_encoded_alike(yaw: float, sx: float, sy: float) -> None:
    encoding = ParameterEncoding(MODELS["box"], "quarter_turn")
    box = torch.tensor([[0.1, 0.2, yaw, sx, sy, 0.3]])
    turned = torch.tensor([[0.1, 0.2, yaw + np.pi / 2.0, sy, sx, 0.3]])
    torch.testing.assert_close(encoding.encode(box), encoding.encode(turned), atol=1e-5, rtol=0)


@pytest.mark.parametrize("name", MODELS)
def test_any_output_decodes_to_an_invertible_transformation(name: str) -> None:
    """An untrained or diverging network must not break the morphing."""
    model = MODELS[name]
    encoding = ParameterEncoding(model, model.symmetry)
    outputs = torch.full((1, encoding.size), -1e30, dtype=torch.float64)
    theta, _ = model.split(encoding.decode(outputs).numpy())
    assert np.isfinite(model.transformation.inverse(theta)).all()
