"""Weight files of networks for walls: what is saved comes back, and wrong files are refused."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import torch
from safetensors import safe_open
from safetensors.torch import load_file, save_file

from kmn_perception.doors.settings import DoorSettings
from kmn_perception.doors.view_cells import describe_cells
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.network import wall_weights, weight_file, weights
from kmn_perception.network.paper_network import PaperNetwork
from kmn_perception.network.wall_network import CHANNELS, ROWS, WallNetwork, propose
from kmn_perception.network.weight_file import WeightsError

CELLS = describe_cells(DoorSettings.load())


@pytest.fixture
def network() -> WallNetwork:
    torch.manual_seed(2)
    return WallNetwork(8).eval()


@pytest.fixture
def file(tmp_path: Path, network: WallNetwork) -> Path:
    path = tmp_path / "mine.safetensors"
    metadata = {"training": {"seed": 7}, "errors": {"right": {"edges": 0.5}}}
    wall_weights.save(path, wall_weights.WallWeights(network, CELLS, metadata))
    return path


def test_a_network_comes_back_with_the_same_proposals(file: Path, network: WallNetwork) -> None:
    loaded = wall_weights.load(file, CELLS)
    cells = np.random.default_rng(0).uniform(-1.0, 1.0, (CHANNELS, ROWS, 40)).astype(np.float32)
    for found, expected in zip(
        propose(loaded.network, cells), propose(network, cells), strict=True
    ):
        np.testing.assert_allclose(found, expected, atol=1e-6)
    assert not loaded.network.training
    assert loaded.metadata["training"] == {"seed": 7}
    assert loaded.metadata["errors"] == {"right": {"edges": 0.5}}


def test_the_file_says_what_it_holds_without_code_of_ours(file: Path) -> None:
    with safe_open(str(file), framework="np") as opened:
        metadata = {key: json.loads(text) for key, text in opened.metadata().items()}
    assert metadata["format"] == weight_file.FORMAT
    assert metadata["design"] == {"width": 8, "kinds": ["lever", "knob", "bar"], "cells": CELLS}


def test_missing_weights_are_named() -> None:
    with pytest.raises(WeightsError, match="no weights: 'nowhere' is neither"):
        wall_weights.load("nowhere", CELLS)


@pytest.mark.parametrize("size", [0, 4, 500])
def test_truncated_weights_are_refused(file: Path, size: int) -> None:
    file.write_bytes(file.read_bytes()[:size])
    with pytest.raises(WeightsError, match="mine.safetensors is not a readable safetensors"):
        wall_weights.load(file, CELLS)


def test_a_foreign_file_is_refused(file: Path) -> None:
    save_file({"weight": torch.zeros(3)}, str(file))
    with pytest.raises(WeightsError, match="is no weight file of ours"):
        wall_weights.load(file, CELLS)


def test_networks_of_the_other_kind_are_refused(file: Path) -> None:
    door = KinematicModel.load("door")
    with pytest.raises(WeightsError, match="holds a network of design 'wall' .known: "):
        weights.load(file, door)
    morphing = weights.Weights(PaperNetwork(door, [1] * 5), None, weights.describe(door))
    weights.save(file, morphing)
    with pytest.raises(WeightsError, match="design 'paper', not one that proposes doors in walls"):
        wall_weights.load(file, CELLS)


def test_weights_for_other_cells_are_refused(file: Path) -> None:
    with pytest.raises(
        WeightsError, match="trained for other views of walls: its cells are .*, here they are"
    ):
        wall_weights.load(file, {**CELLS, "pixel": 0.01})


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"format": "kmn-weights-1"}, "is of another version: train it anew"),
        ({"design": None}, "describes no network for walls: its design is None"),
        ({"design": {"width": 7}}, "describes no network for walls"),
        ({"design": {"width": 8, "kinds": ["lever"]}}, "its kinds are .'lever'., here they are"),
        (
            {"design": {"width": 12, "kinds": ["lever", "knob", "bar"], "cells": CELLS}},
            "does not hold the network that it describes",
        ),
    ],
)
def test_a_file_that_says_something_else_is_refused(
    file: Path, change: dict[str, object], text: str
) -> None:
    with safe_open(str(file), framework="pt") as opened:
        metadata = opened.metadata() | {key: json.dumps(value) for key, value in change.items()}
    save_file(load_file(str(file)), str(file), metadata)
    with pytest.raises(WeightsError, match=text):
        wall_weights.load(file, CELLS)
