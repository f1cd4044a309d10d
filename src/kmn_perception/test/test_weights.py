"""Weight files: what is saved comes back, and wrong files are refused with the reason."""

import json
from pathlib import Path

import pytest
import torch
from safetensors.torch import load_file, save_file

from kmn_perception import weights
from kmn_perception.kinematic_model import KinematicModel
from kmn_perception.network import MorphNetwork

DOOR = KinematicModel.load("door")
CHANNELS = [1, 1, 2, 2, 3]


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "mine.safetensors"
    metadata = {**weights.describe(DOOR), "channels": CHANNELS, "training": {"seed": 7}}
    networks = MorphNetwork(DOOR, CHANNELS), MorphNetwork(DOOR, CHANNELS)
    weights.save(path, weights.Weights(*networks, metadata))
    return path


def test_networks_and_metadata_come_back(file: Path) -> None:
    loaded = weights.load(file, DOOR)
    stored = load_file(str(file))
    for name, tensor in loaded.kmn.state_dict().items():
        torch.testing.assert_close(tensor, stored[f"kmn.{name}"])
    for name, tensor in loaded.baseline.state_dict().items():
        torch.testing.assert_close(tensor, stored[f"baseline.{name}"])
    assert loaded.metadata["training"] == {"seed": 7}


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
    with pytest.raises(weights.WeightsError, match="not a weight file of ours"):
        weights.load(file, DOOR)


def test_a_file_with_other_tensors_than_it_says_is_refused(file: Path) -> None:
    metadata = {**weights.describe(DOOR), "channels": [2, 2, 2, 2, 2], "format": weights.FORMAT}
    text = {key: json.dumps(value) for key, value in metadata.items()}
    save_file(load_file(str(file)), str(file), text)
    with pytest.raises(weights.WeightsError, match="does not hold the network that it describes"):
        weights.load(file, DOOR)
