"""The training tool with a tiny budget: it learns, resumes to the same weights, and is refused."""

import signal
import socket
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from safetensors.torch import load_file

from kmn_perception.configuration.section import ConfigurationError
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.network import weights
from kmn_perception.training.procedures import load_training_settings
from kmn_perception.training.samples import sample
from kmn_perception.training.train import arguments, settings_of

ARGUMENTS = ["kmn_perception", "train", "--model", "box_a"]
COMMAND = [sys.executable, "-m", *ARGUMENTS]
TRAIN = ["-m", "--", *ARGUMENTS]  # by torchrun, which takes --run for its own otherwise
SMALL = ["--samples", "300", "--epochs", "10", "--retrain-epochs", "1", "--rounds", "1"]


def run(out: Path, *more: str) -> subprocess.CompletedProcess:
    return subprocess.run(
        [*COMMAND, "--out", str(out), *SMALL, *more], capture_output=True, text=True, check=False
    )


@pytest.fixture(scope="module")
def trained(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the weights of a run that nothing disturbed."""
    out = tmp_path_factory.mktemp("whole") / "w.safetensors"
    result = run(out)
    assert result.returncode == 0, result.stderr
    return out


def test_training_learns_and_documents_itself(trained: Path) -> None:
    loaded = weights.load(trained, KinematicModel.load("box_a"))
    by_step = loaded.metadata["errors"]["by_round_and_step"]
    assert by_step[-1][-1] < 0.1 * by_step[-1][0]
    assert loaded.metadata["training"]["samples"] == 300
    assert loaded.metadata["camera"]["width"] == 640
    assert list((trained.with_suffix(".run") / "curves").iterdir())


def test_an_interrupted_run_resumes_to_the_same_weights(trained: Path, tmp_path: Path) -> None:
    resumed = tmp_path / "resumed.safetensors"
    with subprocess.Popen(
        [*COMMAND, "--out", str(resumed), *SMALL], stderr=subprocess.PIPE, text=True
    ) as process:
        assert process.stderr is not None
        assert any("fit" in line for line in process.stderr)
        process.send_signal(signal.SIGINT)
        _, rest = process.communicate(timeout=60)
    assert process.returncode != 0
    assert "resumes from the last checkpoint" in rest
    assert "Traceback" not in rest
    again = run(resumed)
    assert again.returncode == 0
    assert "resuming in round 0" in again.stdout + again.stderr
    for name, tensor in load_file(str(trained)).items():
        np.testing.assert_array_equal(tensor.numpy(), load_file(str(resumed))[name].numpy())


def test_a_run_with_other_settings_is_not_continued(trained: Path) -> None:
    other = run(trained, "--seed", "99")
    assert other.returncode != 0
    assert "holds a run with other settings" in other.stderr
    assert "Traceback" not in other.stderr


@pytest.mark.slow
def test_two_processes_train_together(tmp_path: Path) -> None:
    out = tmp_path / "w.safetensors"
    torchrun = [sys.executable, "-m", "torch.distributed.run", "--standalone"]
    result = subprocess.run(
        [*torchrun, "--nproc-per-node", "2", *TRAIN, "--out", str(out), *SMALL],
        capture_output=True,
        text=True,
        check=False,
    )
    assert result.returncode == 0, result.stderr
    errors = weights.load(out, KinematicModel.load("box_a")).metadata["errors"]
    by_step = errors["by_round_and_step"]
    assert by_step[-1][-1] < 0.2 * by_step[-1][0]


class Machines:
    """Two machines that train together, each with a folder of its own or both with the same."""

    def __init__(self, folder: Path, shared: bool) -> None:
        folders = [folder, folder] if shared else [folder / "0", folder / "1"]
        for each in folders:
            each.mkdir(parents=True, exist_ok=True)
        self.out = folders[0] / "w.safetensors"
        self.runs = [each / "run" for each in folders]

    def start(self) -> list[subprocess.Popen[str]]:
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            port = free.getsockname()[1]
        torchrun = [sys.executable, "-m", "torch.distributed.run", "--nnodes=2"]
        torchrun += ["--master-addr=127.0.0.1", f"--master-port={port}"]
        command = [*TRAIN, "--out", str(self.out), *SMALL]
        return [
            subprocess.Popen(
                [*torchrun, f"--node-rank={rank}", *command, "--run", str(folder)],
                stderr=subprocess.PIPE,
                text=True,
            )
            for rank, folder in enumerate(self.runs)
        ]

    def train(self) -> dict[str, Any]:
        """Return the tensors that come of it."""
        processes = self.start()
        ends = [process.communicate(timeout=120)[1] for process in processes]
        assert [process.returncode for process in processes] == [0, 0], ends
        return dict(load_file(str(self.out)))


@pytest.mark.slow
@pytest.mark.timeout(600)
@pytest.mark.parametrize(("phase", "shared"), [("data", True), ("fit", False)])
def test_machines_that_were_interrupted_go_on_with_the_data_of_each(
    phase: str, shared: bool, tmp_path: Path
) -> None:
    whole = Machines(tmp_path / "whole", shared=True).train()
    interrupted = Machines(tmp_path / "interrupted", shared)
    processes = interrupted.start()
    shown = processes[0].stderr
    assert shown is not None
    assert any(phase in line and " 0/" not in line for line in shown)
    for process in processes:
        process.send_signal(signal.SIGTERM)
    for process in processes:
        process.communicate(timeout=60)
    there = [(folder / "checkpoint.pt").exists() for folder in interrupted.runs]
    assert there == [True, shared]
    resumed = interrupted.train()
    assert resumed.keys() == whole.keys()
    for name, tensor in whole.items():
        np.testing.assert_array_equal(tensor.numpy(), resumed[name].numpy())


@pytest.mark.slow
def test_the_papers_network_learns_too(tmp_path: Path) -> None:
    out = tmp_path / "w.safetensors"
    result = run(out, "--config", "paper/box_a")
    assert result.returncode == 0, result.stderr
    loaded = weights.load(out, KinematicModel.load("box_a"))
    assert loaded.baseline is not None
    by_step = loaded.metadata["errors"]["by_round_and_step"]
    assert by_step[-1][-1] < 0.5 * by_step[-1][0]


def test_samples_are_the_same_for_the_same_seed_only() -> None:
    model = KinematicModel.load("door")
    observation, values = sample(model, 5, 17)
    again, same = sample(model, 5, 17)
    np.testing.assert_array_equal(observation.points, again.points)
    np.testing.assert_array_equal(values, same)
    assert not np.array_equal(values, sample(model, 6, 17)[1])
    assert not np.array_equal(values, sample(model, 5, 18)[1])


def test_the_command_line_replaces_the_settings() -> None:
    options = arguments(["--model", "door", "--out", "x", "--samples", "50", "--seed", "3"])
    settings = settings_of(options)
    assert (settings.samples, settings.seed) == (50, 3)
    assert settings.network == "cascade"
    assert load_training_settings("paper/door").design["channels"] == [2, 4, 8, 16, 32]  # paper


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("samples: many", "'samples' must be a whole number"),
        ("speed: 3", "unknown key 'speed'"),
    ],
)
def test_wrong_settings_are_refused(tmp_path: Path, line: str, message: str) -> None:
    from kmn_perception.configuration import resources

    key = line.split(":")[0]
    kept = [
        text
        for text in resources.find("config/training", "paper/door").read_text().splitlines()
        if not text.startswith(f"{key}:")
    ]
    file = tmp_path / "mine.yaml"
    file.write_text("\n".join([*kept, line]))
    with pytest.raises(ConfigurationError, match=message):
        load_training_settings(file)


@pytest.mark.slow
def test_more_jobs_make_the_same_data(tmp_path: Path) -> None:
    """Compared are the weights, which no other data would give."""
    one, three = tmp_path / "one.safetensors", tmp_path / "three.safetensors"
    few = ["--samples", "60", "--epochs", "1"]
    for settings in ("paper/box_a", "box_a"):
        assert run(one, "--config", settings, "--restart", *few).returncode == 0
        more = run(three, "--config", settings, "--restart", *few, "--jobs", "3")
        assert more.returncode == 0, more.stderr
        for name, tensor in load_file(str(one)).items():
            np.testing.assert_array_equal(tensor.numpy(), load_file(str(three))[name].numpy())


@pytest.mark.slow
def test_a_training_goes_on_from_a_weight_file(tmp_path: Path) -> None:
    out = tmp_path / "w.safetensors"
    few = ["--samples", "100", "--epochs", "1", "--rounds", "0"]
    for network, shipped in (("cascade", "box_a"), ("paper", "paper/box_a")):
        result = run(out, "--network", network, "--start", shipped, "--restart", *few)
        assert result.returncode == 0, result.stderr
        model = KinematicModel.load("box_a")
        loaded, given = weights.load(out, model), weights.load(shipped, model)
        assert loaded.metadata["start"]["training"] == given.metadata["training"]
        error = loaded.metadata["errors"]["by_round_and_step"][-1]
        assert error[1] < 0.2 * error[0]  # four batches from nothing stay above 0.5
        assert any(
            not torch.equal(tensor, given.network.state_dict()[name])
            for name, tensor in loaded.network.state_dict().items()
        )
        assert (loaded.baseline is None) == (given.baseline is None)
        if loaded.baseline is not None and given.baseline is not None:  # the first one's
            for name, tensor in given.baseline.state_dict().items():
                assert torch.equal(tensor, loaded.baseline.state_dict()[name])


def test_a_network_of_another_design_is_not_trained_on(tmp_path: Path) -> None:
    result = run(tmp_path / "w.safetensors", "--network", "cascade", "--start", "paper/box_a")
    assert result.returncode == 1
    assert "paper/box_a cannot be trained on with these settings: its network is" in result.stderr
    assert "Traceback" not in result.stderr
