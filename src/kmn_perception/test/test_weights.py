"""Weight files: what is saved comes back, and wrong files are refused with the reason."""

import json
from pathlib import Path

import numpy as np
import pytest
import torch
from safetensors import safe_open
from safetensors.torch import load_file, save_file

from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.network import weights
from kmn_perception.network.cascade import Cascade
from kmn_perception.network.cascade_settings import CascadeSettings
from kmn_perception.network.paper_network import PaperNetwork

DOOR = KinematicModel.load("door")
CHANNELS = [1, 1, 2, 2, 3]


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "mine.safetensors"
    metadata = {**weights.describe(DOOR), "training": {"seed": 7}}
    networks = PaperNetwork(DOOR, CHANNELS), PaperNetwork(DOOR, CHANNELS)
    weights.save(path, weights.Weights(*networks, metadata))
    return path


def test_networks_and_metadata_come_back(file: Path) -> None:
    loaded = weights.load(file, DOOR)
    stored = load_file(str(file))
    for name, tensor in loaded.network.state_dict().items():
        torch.testing.assert_close(tensor, stored[f"network.{name}"])
    assert loaded.baseline is not None
    for name, tensor in loaded.baseline.state_dict().items():
        torch.testing.assert_close(tensor, stored[f"baseline.{name}"])
    assert loaded.metadata["training"] == {"seed": 7}


def test_a_cascade_comes_back_with_the_same_predictions(tmp_path: Path) -> None:
    torch.manual_seed(3)
    network = Cascade(DOOR, CascadeSettings.load(), stages=2).eval()
    path = tmp_path / "cascade.safetensors"
    weights.save(path, weights.Weights(network, None, weights.describe(DOOR)))
    loaded = weights.load(path, DOOR)
    assert loaded.baseline is None
    assert loaded.network.steps == 2
    images = [torch.rand(1, *kind.shape).numpy() for kind in network.input_types(1)]
    np.testing.assert_allclose(
        loaded.network.predict(1, tuple(images)), network.predict(1, tuple(images)), atol=1e-6
    )


def test_a_design_that_is_none_of_ours_is_refused(tmp_path: Path, file: Path) -> None:
    metadata = {
        **weights.describe(DOOR),
        "network": "cascade",
        "design": {"settings": {"margins": []}, "stages": 1},
        "format": weights.FORMAT,
    }
    text = {key: json.dumps(value) for key, value in metadata.items()}
    save_file(load_file(str(file)), str(file), text)
    with pytest.raises(weights.WeightsError, match="describes no network for 'door'"):
        weights.load(file, DOOR)


def test_missing_weights_are_named() -> None:
    with pytest.raises(weights.WeightsError, match="no weights: 'nowhere.safetensors' is neither"):
        weights.load("nowhere.safetensors", DOOR)


@pytest.mark.parametrize("size", [0, 4, 500])
def test_truncated_weights_are_refused(file: Path, size: int) -> None:
    file.write_bytes(file.read_bytes()[:size])
    with pytest.raises(
        weights.WeightsError, match="mine.safetensors is not a readable safetensors"
    ):
        weights.load(file, DOOR)


def test_weights_of_another_model_are_refused(file: Path) -> None:
    with pytest.raises(weights.WeightsError, match="trained for another model: its model is door"):
        weights.load(file, KinematicModel.load("box_a"))


def test_a_foreign_safetensors_file_is_refused(file: Path) -> None:
    save_file({"weight": torch.zeros(3)}, str(file))
    with pytest.raises(weights.WeightsError, match="is no weight file of ours"):
        weights.load(file, DOOR)


def _with_metadata(file: Path, key: str, value: object) -> None:
    with safe_open(str(file), framework="pt") as opened:
        metadata = {**opened.metadata(), key: json.dumps(value)}
        tensors = {name: opened.get_tensor(name) for name in opened.keys()}
    save_file(tensors, str(file), metadata)


@pytest.mark.parametrize(
    ("key", "value", "text"),
    [
        (
            "format",
            "kmn-weights-2",
            "mine.safetensors is of another version: train it anew",
        ),
        ("network", ["cascade"], r"a network of design \['cascade'\] \(known: "),
    ],
)
def test_a_file_of_another_version_or_design_says_so(
    file: Path, key: str, value: object, text: str
) -> None:
    _with_metadata(file, key, value)
    with pytest.raises(weights.WeightsError, match=text):
        weights.load(file, DOOR)


def test_a_file_with_other_tensors_than_it_says_is_refused(file: Path) -> None:
    design = {"channels": [2, 2, 2, 2, 2], "input": vars(DOOR.input)}
    metadata = {
        **weights.describe(DOOR), "network": "paper", "design": design, "format": weights.FORMAT,
    }  # fmt: skip
    text = {key: json.dumps(value) for key, value in metadata.items()}
    save_file(load_file(str(file)), str(file), text)
    with pytest.raises(weights.WeightsError, match="does not hold the network that it describes"):
        weights.load(file, DOOR)
