"""The evaluation, with networks whose answers and thus whose errors are known."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import shlex
import signal
import subprocess
import sys
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from kmn_perception.configuration import resources
from kmn_perception.evaluation.comparison import Request
from kmn_perception.evaluation.evaluate import experiment, main
from kmn_perception.evaluation.settings import EvaluationSettings
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.network import weights
from kmn_perception.network.paper_network import PaperNetwork
from kmn_perception.training.samples import EVALUATION, sample

BOX_A = KinematicModel.load("box_a")
SENSOR = {
    "camera": "kinect_v1", "distance": [0.5, 1.5], "azimuth": [-0.6, 0.6], "elevation": [0.4, 1.2],
    "noise": "kinect", "holes": 0.0, "pose_error": [0.0, 0.0], "occlusion": 0.0, "cut_height": 0.0,
}  # fmt: skip
SETTINGS = EvaluationSettings.load()


def constant(model: KinematicModel, answer: list[float]) -> PaperNetwork:
    """Return a network that answers the same (theta, gamma) to every image."""
    network = PaperNetwork(model, [1, 1, 1, 1, 1])
    with torch.no_grad():
        network.linear.weight.zero_()
        network.linear.bias.copy_(network.encoding.encode(torch.tensor([answer]))[0])
    return network


def save_constant(
    path: Path, name: str, answer: list[float], baseline: list[float] | None = None, **training: Any
) -> str:
    """Write weights that answer the same to every image; return the path."""
    model = KinematicModel.load(name)
    known = {**weights.describe(model), "training": training}
    first = None if baseline is None else constant(model, baseline)
    weights.save(path, weights.Weights(constant(model, answer), first, known))
    return str(path)


def run(folder: Path, name: str, *more: str) -> dict[str, Any]:
    out = folder / "result.json"
    main(["--model", name, "--json", str(out), *more])
    result: dict[str, Any] = json.loads(out.read_text())
    return result


def test_the_written_errors_are_those_of_known_predictions(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A box that is only moved: k predictions of a step (a, b) lead to (k a, k b)."""
    steps = {"baseline": [0.1, 0.02], "kmn_paper": [-0.03, 0.05], "kmn": [0.04, 0.01]}
    paper = save_constant(
        tmp_path / "paper.safetensors", "box_a", steps["kmn_paper"], steps["baseline"]
    )
    own = save_constant(tmp_path / "own.safetensors", "box_a", steps["kmn"])
    given = ("--samples", "20", "--seed", "4", "--weights", own, "--paper-weights", paper)
    result = run(tmp_path, "box_a", *given, "--methods", *steps)
    printed = capsys.readouterr().out.splitlines()
    assert {key: result[key] for key in ("model", "samples", "seed", "noise")} == {
        "model": "box_a", "samples": 20, "seed": 4, "noise": "none",
    }  # fmt: skip
    assert result["weights"] == {
        role: hashlib.sha256(Path(file).read_bytes()).hexdigest()[:12]
        for role, file in (("paper", paper), ("own", own))
    }
    assert shlex.split(result["command"]) == [
        "./run", "kmn_perception", "evaluate", "--model", "box_a", *given, "--methods", *steps,
    ]  # fmt: skip
    assert datetime.fromisoformat(result["date"]).tzinfo is not None
    assert list(result["methods"]) == list(steps)
    truth = np.stack([sample(BOX_A, 4, i, spawn_key=EVALUATION)[1] for i in range(20)])
    for name, step in steps.items():
        counted = 1 if name == "baseline" else 5
        errors = np.abs(np.arange(11)[:, None, None] * np.array(step) - truth)
        sums = errors.sum(axis=2)
        found = result["methods"][name]
        assert found["samples"] == 20
        assert found["milliseconds"] > 0.0
        assert found["by_step"] == pytest.approx(sums.mean(axis=1), abs=1e-6)
        assert found["by_step_std"] == pytest.approx(sums.std(axis=1), abs=1e-6)
        assert found["per_parameter"] == pytest.approx(
            dict(zip("xy", errors[counted].mean(axis=0), strict=True)), abs=1e-6
        )
        assert found["per_parameter_median"] == pytest.approx(
            dict(zip("xy", np.median(errors[counted], axis=0), strict=True)), abs=1e-6
        )
        assert found["mean"] == pytest.approx(sums[counted].mean(), abs=1e-6)
        assert found["median"] == pytest.approx(np.median(sums[counted]), abs=1e-6)
        assert found["p95"] == pytest.approx(np.quantile(sums[counted], 0.95), abs=1e-6)
        assert found["best"] == np.argsort(sums[counted])[:3].tolist()
        assert found["worst"] == np.argsort(-sums[counted])[:3].tolist()
        reported = SETTINGS.paper["box_a"]["baseline" if name == "baseline" else "kmn"]["mean"]
        summary = next(line for line in printed if line.startswith(f"{name} "))
        assert summary.split()[1] == f"{found['mean']:.5f}"
        assert summary.split()[4:6] == [f"{reported:.5f}", f"{found['mean'] / reported:.2f}"]


@pytest.mark.parametrize("name", ["box_a", "door"])
def test_every_method_has_a_row_for_every_model(tmp_path: Path, name: str) -> None:
    count = len(KinematicModel.load(name).parameters)
    paper = save_constant(tmp_path / "paper.safetensors", name, [0.1] * count, [0.1] * count)
    own = save_constant(tmp_path / "own.safetensors", name, [0.0] * count)
    trained = ("--weights", own, "--paper-weights", paper)
    result = run(tmp_path, name, "--samples", "3", "--peers", *trained)
    methods = result["methods"]
    assert list(methods) == [
        "baseline", "kmn_paper", "kmn", "kmn_refined", "multistart",
        "icp", "icp_identity", "icp_plane", "small_gicp", "information_limit",
    ]  # fmt: skip
    for statistics in methods.values():
        parts = statistics["by_visible_fraction"]
        assert [part["low"] for part in parts] == list(SETTINGS.visible_bins[:-1])
        assert sum(part["samples"] for part in parts) == 3
    assert {key for key in methods if "coverage95" in methods[key]} == {"kmn_refined", "multistart"}
    # A network that predicts no change stays at the start, from where the refinement begins.
    assert methods["kmn"]["by_step"] == pytest.approx([methods["kmn"]["by_step"][0]] * 11)
    assert methods["kmn_refined"]["by_step"][0] == pytest.approx(methods["kmn"]["mean"])
    assert methods["kmn_refined"]["mean"] < 0.5 * methods["kmn"]["mean"]
    truth = [sample(KinematicModel.load(name), 0, i, spawn_key=EVALUATION)[1] for i in range(3)]
    assert methods["icp_identity"]["by_step"][0] == pytest.approx(np.abs(truth).sum(axis=1).mean())


def test_slow_peers_are_measured_on_fewer_samples_unless_they_are_asked_for() -> None:
    few = dataclasses.replace(SETTINGS, peer_samples=2)
    methods = experiment(Request("box_a", seed=0, peers=True), 4, few).run(1)[1]["methods"]
    counts = {name: methods[name]["samples"] for name in ("kmn_paper", "icp", "information_limit")}
    assert counts == {"kmn_paper": 4, "icp": 2, "information_limit": 4}
    methods = experiment(Request("box_a", seed=0, methods=("small_gicp",)), 4, few).run(1)[1][
        "methods"
    ]
    assert methods["small_gicp"]["samples"] == 4


def test_rows_without_weights_are_left_out_with_a_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A user's own model, before anything was trained."""
    file = tmp_path / "carton.yaml"
    shipped = resources.find("config/models", "box_a").read_text()
    file.write_text(shipped.replace("name: box_a", "name: carton"))
    result = run(tmp_path, str(file), "--samples", "2", "--peers")
    assert list(result["methods"]) == [
        "multistart", "icp", "icp_identity", "icp_plane", "small_gicp", "information_limit",
    ]  # fmt: skip
    assert result["weights"] == {}
    lines = capsys.readouterr().err
    for name in ("baseline", "kmn_paper", "kmn", "kmn_refined"):
        assert f"{name} is left out: no weights: " in lines
    with pytest.raises(SystemExit, match="evaluate: kmn_paper: no weights: 'paper/carton'"):
        run(tmp_path, str(file), "--samples", "2", "--methods", "kmn_paper")


@settings(deadline=None, max_examples=20)
@given(*[st.integers(0, 2**40), st.integers(0, 2**20)] * 2)
def test_no_sample_of_any_seed_is_one_that_trains(
    seed: int, index: int, training_seed: int, training_index: int
) -> None:
    _, values = sample(BOX_A, seed, index, spawn_key=EVALUATION)
    for number in (seed, index), (training_seed, training_index):
        assert not np.array_equal(values, sample(BOX_A, *number)[1])


def test_a_seed_gives_the_same_errors_again_and_another_seed_others(tmp_path: Path) -> None:
    few = ("--samples", "5", "--methods", "icp", "--seed")
    first, again, other = (
        run(tmp_path, "box_b", *few, seed)["methods"]["icp"]["by_step"] for seed in ("7", "7", "8")
    )
    assert first == again != other


@pytest.mark.slow
def test_several_processes_measure_the_same_as_one(tmp_path: Path) -> None:
    few = ("--samples", "51", "--methods", "kmn_paper", "information_limit", "--jobs")
    one, two = (run(tmp_path, "box_a", *few, jobs)["methods"] for jobs in ("1", "2"))
    for statistics in (*one.values(), *two.values()):
        del statistics["milliseconds"]
    assert one == two


def test_samples_are_seen_as_in_training_unless_noise_is_given(tmp_path: Path) -> None:
    weights_of = {
        name: save_constant(
            tmp_path / f"{name}.safetensors", name, [0.0] * count, [0.0] * count, sensor=sensor
        )
        for name, count, sensor in (("box", 6, SENSOR), ("box_a", 2, None))
    }
    few = ("--samples", "3", "--methods", "baseline", "--paper-weights")
    trained = run(tmp_path, "box", *few, weights_of["box"])
    exact = run(tmp_path, "box", *few, weights_of["box"], "--noise", "none")
    assert (trained["noise"], exact["noise"]) == ("kinect", "none")
    # The start, above the cloud's centre, depends on what the sensor sees.
    steps = [result["methods"]["baseline"]["by_step"][0] for result in (trained, exact)]
    assert steps[0] != steps[1]
    assert run(tmp_path, "box_a", *few, weights_of["box_a"])["noise"] == "none"


@pytest.mark.parametrize(
    ("more", "message"),
    [
        (["--weights", "nowhere.safetensors"], "no weights: 'nowhere.safetensors'"),
        (["--model", "box_b"], "trained for another model"),
        (["--model", "boat"], "'boat' is neither a file nor one of the shipped config/models"),
        (["--methods", "baseline"], "baseline: the weights of 'door' hold no baseline"),
        (["--methods", "magic"], "invalid choice: 'magic'"),
        (["--seed", "-1"], "-1 is not a whole number from 0"),
        (["--samples", "0"], "0 is not a whole number from 1"),
        (["--jobs", "0"], "0 is not a whole number from 1"),
        (
            ["--json", "nowhere/result.json"],
            "nowhere/result.json is not a file in a folder that exists",
        ),
    ],
)
def test_bad_arguments_end_with_a_message(
    tmp_path: Path, more: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    path = save_constant(tmp_path / "door.safetensors", "door", [0.0] * 7)
    with pytest.raises(SystemExit) as ending:
        main(["--model", "door", "--paper-weights", path, "--samples", "2", *more])
    assert message in f"{ending.value} {capsys.readouterr().err}"


def test_ctrl_c_ends_it_without_a_traceback() -> None:
    command = [sys.executable, "-m", "kmn_perception", "evaluate", "--model", "box_a"]
    with subprocess.Popen(
        [*command, "--methods", "icp", "--samples", "100000", "--jobs", "2"],
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        assert process.stderr is not None
        assert any("evaluate box_a" in line for line in process.stderr)
        process.send_signal(signal.SIGINT)
        _, rest = process.communicate(timeout=60)
    assert process.returncode != 0
    assert rest.endswith("evaluate: interrupted\n")
    assert "Traceback" not in rest
