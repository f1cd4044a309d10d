"""Another design of network is a class and its name: it is trained, written and read like ours."""

from __future__ import annotations

import signal
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
import yaml
from numpy.typing import NDArray
from torch import Tensor, nn

from kmn_perception.configuration import resources
from kmn_perception.configuration.section import ConfigurationError, Section
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.model.observation import Observation
from kmn_perception.network import weights
from kmn_perception.network.designs import DESIGNS
from kmn_perception.network.encoding import ParameterEncoding
from kmn_perception.network.morph_network import Inputs, InputType, MorphNetwork
from kmn_perception.network.paper_network import PaperNetwork
from kmn_perception.training import train
from kmn_perception.training.procedures import PROCEDURES, load_training_settings

BOX_A = KinematicModel.load("box_a")


class CentreNetwork(MorphNetwork):
    """Predicts from the centre of the points alone, by a linear layer."""

    name = "centre"
    procedure = "algorithm2"

    def __init__(self, model: KinematicModel) -> None:
        super().__init__(model)
        self.encoding = ParameterEncoding(model, model.symmetry)
        self.linear = nn.Linear(3, self.encoding.size)

    @classmethod
    def untrained(cls, model: KinematicModel, design: Section) -> CentreNetwork:
        design.allow(())
        return cls(model)

    described = untrained

    def forward(self, centre: Tensor) -> Tensor:
        codes: Tensor = self.linear(centre)
        return codes

    def start(self, observations: Sequence[Observation]) -> NDArray[np.float64]:
        return np.tile(self.model.prototype, (len(observations), 1))

    def render_anew(
        self, step: int, observations: Sequence[Observation], values: NDArray[np.float64]
    ) -> Inputs:
        centres = np.stack([o.points.mean(axis=0) for o in observations])
        centres[:, :2] -= values
        return (centres.astype(np.float32),)

    @torch.inference_mode()
    def predict(self, step: int, inputs: Inputs) -> NDArray[np.float64]:
        decoded: NDArray[np.float64] = self.encoding.decode(
            self(torch.from_numpy(inputs[0])).double()
        ).numpy()
        return decoded

    def concatenate(
        self, values: NDArray[np.float64], predicted: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        return values + predicted

    def remainder(
        self, values: NDArray[np.float64], truth: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        return truth - values

    def input_types(self, step: int) -> tuple[InputType, ...]:
        return (InputType((3,), np.float32),)

    def describe(self) -> dict[str, Any]:
        return {}


def test_another_design_is_trained_and_read_by_its_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(DESIGNS, CentreNetwork.name, CentreNetwork)
    settings = tmp_path / "mine.yaml"
    settings.write_text(
        "network: paper\nsamples: 300\naugmentation: 0.1\nrounds: 1\nepochs: 20\n"
        "retrain_epochs: 1\npatience: 0.0\nbatch: 32\nlearning_rate: 0.02\nseed: 1\n"
    )
    out = tmp_path / "w.safetensors"
    given = ["--model", "box_a", "--config", str(settings), "--out", str(out)]
    handlers = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    train.train(train.arguments([*given, "--network", "centre"]))
    for number, handler in handlers.items():
        signal.signal(number, handler)
    loaded = weights.load(out, BOX_A)
    assert isinstance(loaded.network, CentreNetwork)
    assert loaded.metadata["network"] == loaded.metadata["training"]["network"] == "centre"
    by_step = loaded.metadata["errors"]["by_round_and_step"][-1]
    assert by_step[1] < 0.2 * by_step[0]
    monkeypatch.delitem(DESIGNS, CentreNetwork.name)
    with pytest.raises(weights.WeightsError, match=r"of design 'centre' \(known: cascade, paper\)"):
        weights.load(out, BOX_A)


def test_every_design_is_known_by_its_name_and_can_be_trained() -> None:
    assert list(DESIGNS) == ["cascade", "paper"]
    for name, kind in DESIGNS.items():
        assert kind.name == name
        assert kind.procedure in PROCEDURES


def test_the_command_line_chooses_the_settings_of_a_design() -> None:
    options = train.arguments(["--model", "door", "--network", "paper", "--out", "w"])
    assert train.settings_of(options) == load_training_settings("paper/door")


@pytest.mark.parametrize("model", ["drawer", "some/where/mine.yaml"])
def test_a_model_without_settings_of_its_own_is_trained_by_those_for_any(model: str) -> None:
    options = train.arguments(["--model", model, "--out", "w", "--seed", "7"])
    assert train.settings_of(options) == load_training_settings("default", {"seed": 7})
    options = train.arguments(["--model", model, "--config", "box_c", "--out", "w"])
    assert train.settings_of(options) == load_training_settings("box_c")


def test_settings_of_another_design_are_refused() -> None:
    with pytest.raises(ConfigurationError, match="box_a.yaml: key 'augmentation' is missing"):
        load_training_settings("box_a", {"network": "paper"})
    with pytest.raises(ConfigurationError, match="'network' must be one of cascade, paper, found"):
        load_training_settings("box_a", {"network": "magic"})


def test_settings_with_a_camera_that_is_not_there_are_refused() -> None:
    sensor = resources.find("config/training", "robust/door").read_text(encoding="utf-8")
    changed = {**yaml.safe_load(sensor)["sensor"], "camera": "lens"}
    with pytest.raises(ConfigurationError, match="door.yaml: sensor: camera: 'lens' is neither"):
        load_training_settings("robust/door", {"sensor": changed})


@pytest.mark.parametrize(
    ("design", "message"),
    [
        ({}, "mine: key 'channels' is missing"),
        ({"channels": [2, 4]}, "mine: 'channels' must be 5 numbers"),
        ({"channels": [1, 1, 1, 1, 1], "depth": 3}, "mine: unknown key 'depth'"),
    ],
)
def test_wrong_designs_are_refused(design: dict[str, Any], message: str) -> None:
    with pytest.raises(ConfigurationError, match=message):
        PaperNetwork.untrained(BOX_A, Section(design, "mine"))


def test_a_network_of_other_depth_images_is_refused() -> None:
    design = PaperNetwork(BOX_A, [1, 1, 1, 1, 1]).describe()
    design["input"]["contrast"] += 1.0
    with pytest.raises(ConfigurationError, match="'input' is .*that of model 'box_a' is"):
        PaperNetwork.described(BOX_A, Section(design, "mine"))
