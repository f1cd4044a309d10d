"""What goes wrong with a training is said in a line, before the work where that can be known."""

from __future__ import annotations

import resource
import shutil
import signal
import subprocess
import sys
from argparse import ArgumentTypeError
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from kmn_perception.command_line.arguments import output_file, output_folder
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.network import weights
from kmn_perception.network.morph_network import InputType
from kmn_perception.network.paper_network import PaperNetwork
from kmn_perception.training.dataset import Dataset
from kmn_perception.training.run import RunError
from kmn_perception.training.train import arguments

COMMAND = [sys.executable, "-m", "kmn_perception", "train", "--model", "box_a"]
SMALL = ["--samples", "300", "--epochs", "10", "--retrain-epochs", "1", "--rounds", "1"]
INPUTS = [InputType((4, 3), np.float16)]


def start(out: Path, *more: str, file_size: int | None = None) -> subprocess.Popen[str]:
    """Start a small training, whose files can be limited to a size in bytes."""

    def limit() -> None:
        if file_size:
            resource.setrlimit(resource.RLIMIT_FSIZE, (file_size, file_size))

    return subprocess.Popen(
        [*COMMAND, "--out", str(out), *SMALL, *more],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        preexec_fn=limit,
    )


def last_line(process: subprocess.Popen[str]) -> str:
    """Return what a program says at its end, which must not be a traceback."""
    output, _ = process.communicate(timeout=300)
    assert process.returncode == 1, output
    assert "Traceback" not in output
    return output.splitlines()[-1]


@pytest.fixture(scope="module")
def interrupted(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the weight file of a training that was interrupted while it fitted."""
    out = tmp_path_factory.mktemp("interrupted") / "w.safetensors"
    with start(out) as process:
        assert process.stdout is not None
        assert any("fit" in line for line in process.stdout)
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=300)
    assert not out.exists()
    return out


@pytest.fixture
def resumable(interrupted: Path, tmp_path: Path) -> Path:
    shutil.copytree(interrupted.with_suffix(".run"), tmp_path / "w.run")
    return tmp_path / "w.safetensors"


def _remove(folder: Path) -> None:
    shutil.rmtree(folder / "data0")


def _truncate(folder: Path) -> None:
    file = folder / "data0" / "round0" / "values.npy"
    file.write_bytes(file.read_bytes()[:-1000])


def _replace_by_another(folder: Path) -> None:
    np.save(folder / "data0" / "round0" / "values.npy", np.zeros((10, 2)))


@pytest.mark.parametrize(
    "damage",
    [_remove, *(pytest.param(d, marks=pytest.mark.slow) for d in (_truncate, _replace_by_another))],
)
def test_a_run_without_its_data_is_not_resumed(
    resumable: Path, damage: Callable[[Path], None]
) -> None:
    damage(resumable.with_suffix(".run"))
    line = last_line(start(resumable))
    assert line.startswith("train: the run cannot be resumed, its training data ")
    assert "use --restart to train from the beginning" in line
    assert not resumable.exists()


@pytest.mark.parametrize("size", [0, 1000])
def test_a_truncated_checkpoint_is_named(resumable: Path, size: int) -> None:
    checkpoint = resumable.with_suffix(".run") / "checkpoint.pt"
    checkpoint.write_bytes(checkpoint.read_bytes()[:size])
    line = last_line(start(resumable))
    assert line.startswith(f"train: {checkpoint} is damaged (")
    assert "--restart" in line


def test_a_data_set_without_room_is_refused_before_it_is_filled(tmp_path: Path) -> None:
    line = last_line(start(tmp_path / "w.safetensors", file_size=1_000_000))
    assert line.startswith("train: no room for ")
    assert "MB are free" in line
    assert "--run" in line


def test_on_a_full_disk_nothing_is_mapped(tmp_path: Path) -> None:
    """Where a disk can be mounted; a memory map of it would end with a bus error."""
    disk = tmp_path / "disk"
    disk.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=1m", "tmpfs", str(disk)]
    if subprocess.run(mount, capture_output=True, check=False).returncode:
        pytest.skip("no disk can be mounted")
    try:
        with pytest.raises(RunError, match="no room for .*it takes 2.4 MB, 1.0 MB are free"):
            Dataset(disk, INPUTS, 2, capacity=100_000, filled=0)
        assert not list(disk.iterdir())
    finally:
        subprocess.run(["umount", str(disk)], check=True)


def test_samples_come_back_from_an_earlier_start(tmp_path: Path) -> None:
    images = np.full((2, 4, 3), 0.5, np.float16)
    values = np.array([[0.0, 1.0], [2.0, 3.0]])
    Dataset(tmp_path, INPUTS, 2, capacity=5, filled=0).put(slice(0, 2), (images,), values)
    inputs, found = Dataset(tmp_path, INPUTS, 2, capacity=5, filled=2).batch(slice(0, 2))
    np.testing.assert_array_equal(inputs[0], images)
    np.testing.assert_array_equal(found, values)


def test_a_checkpoint_that_cannot_be_written_leaves_the_last_one(resumable: Path) -> None:
    checkpoint = resumable.with_suffix(".run") / "checkpoint.pt"
    before = checkpoint.read_bytes()
    line = last_line(start(resumable, file_size=100_000))
    assert line.startswith(f"train: cannot write {checkpoint}: ")
    assert checkpoint.read_bytes() == before
    assert not list(checkpoint.parent.glob(".checkpoint*"))


def test_weights_that_cannot_be_written_leave_the_last_ones(tmp_path: Path) -> None:
    model, file = KinematicModel.load("door"), tmp_path / "w.safetensors"
    file.write_text("the last ones")
    trained = weights.Weights(PaperNetwork(model, [1, 1, 1, 1, 1]), None, weights.describe(model))
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (100, limits[1]))
    try:
        with pytest.raises(OSError, match=f"cannot write {file}: "):
            weights.save(file, trained)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert file.read_text() == "the last ones"
    assert list(tmp_path.iterdir()) == [file]


@pytest.mark.parametrize(
    ("more", "message"),
    [
        (["--epochs", "0"], "argument --epochs: 0 is not a whole number from 1"),
        (["--retrain-epochs", "0"], "--retrain-epochs: 0 is not a whole number from 1"),
        (["--rounds", "-1"], "argument --rounds: -1 is not a whole number from 0"),
        (["--samples", "0"], "argument --samples: 0 is not a whole number from 10"),
        (["--seed", "-1"], "argument --seed: -1 is not a whole number from 0"),
        (["--threads", "0"], "argument --threads: 0 is not a whole number from 1"),
        (["--network", "magic"], "invalid choice: 'magic'"),
        (["--out", "."], "argument --out: . is not a file in a folder that exists"),
        (["--out", "/proc/w.safetensors"], "argument --out: nothing can be written to /proc"),
        (["--run", "/proc/run"], "argument --run: nothing can be written to /proc"),
    ],
)
def test_bad_arguments_are_refused_with_the_reason(
    more: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit):
        arguments(["--model", "box_a", "--out", "w.safetensors", *more])
    assert message in capsys.readouterr().err


def test_files_and_folders_to_write_are_told_apart(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    assert output_file(str(tmp_path / "new")) == tmp_path / "new"
    assert output_folder(str(tmp_path / "new" / "below")) == tmp_path / "new" / "below"
    with pytest.raises(ArgumentTypeError, match="is not a folder: .*file is a file"):
        output_folder(str(tmp_path / "file" / "below"))
