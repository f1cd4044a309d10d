"""The evaluation, with networks whose answers and thus whose errors are known."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from kmn_perception import weights
from kmn_perception.evaluation.errors import absolute_errors
from kmn_perception.evaluation.evaluate import Tally, main
from kmn_perception.evaluation.methods import Method
from kmn_perception.evaluation.settings import EvaluationSettings
from kmn_perception.kinematic_model import KinematicModel
from kmn_perception.network import MorphNetwork
from kmn_perception.training.samples import EVALUATION, sample

BOX, BOX_A = KinematicModel.load("box"), KinematicModel.load("box_a")
SENSOR = {
    "camera": "kinect_v1", "distance": [0.5, 1.5], "azimuth": [-0.6, 0.6], "elevation": [0.4, 1.2],
    "noise": "kinect", "occlusion": 0.0, "cut_height": 0.0,
}  # fmt: skip


def constant(model: KinematicModel, answer: list[float]) -> MorphNetwork:
    """Return a network that answers the same (theta, gamma) to every image."""
    network = MorphNetwork(model, [1, 1, 1, 1, 1])
    with torch.no_grad():
        network.linear.weight.zero_()
        network.linear.bias.copy_(network.encoding.encode(torch.tensor([answer]))[0])
    return network


def save_constants(
    folder: Path, name: str, baseline: list[float], kmn: list[float], **training: Any
) -> Path:
    model, path = KinematicModel.load(name), folder / f"{name}.safetensors"
    known = {**weights.describe(model), "channels": [1, 1, 1, 1, 1], "training": training}
    networks = constant(model, kmn), constant(model, baseline)
    weights.save(path, weights.Weights(*networks, known))
    return path


def run(path: Path, *more: str) -> dict[str, Any]:
    out = path.parent / "result.json"
    main(["--model", path.stem, "--weights", str(path), "--json", str(out), *more])
    result: dict[str, Any] = json.loads(out.read_text())
    return result


def test_the_written_errors_are_those_of_known_predictions(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A box that is only moved: k predictions of a step (a, b) lead to (k a, k b)."""
    path = save_constants(tmp_path, "box_a", [0.1, 0.02], [-0.03, 0.05])
    result = run(path, "--samples", "20", "--seed", "4", "--methods", "baseline", "kmn")
    printed = capsys.readouterr().out.splitlines()
    assert {key: value for key, value in result.items() if key != "methods"} == {
        "model": "box_a", "samples": 20, "seed": 4, "noise": "none",
    }  # fmt: skip
    truth = np.stack([sample(BOX_A, 4, i, spawn_key=EVALUATION)[1] for i in range(20)])
    for name, step, counted in (("baseline", [0.1, 0.02], 1), ("kmn", [-0.03, 0.05], 5)):
        errors = np.abs(np.arange(6)[:, None, None] * np.array(step) - truth)
        sums = errors.sum(axis=2)
        found = result["methods"][name]
        assert found.pop("milliseconds") > 0.0
        assert found.pop("by_step") == pytest.approx(sums.mean(axis=1), abs=1e-6)
        assert found.pop("per_parameter") == pytest.approx(
            dict(zip("xy", errors[counted].mean(axis=0), strict=True)), abs=1e-6
        )
        assert found == pytest.approx(
            {
                "mean": sums[counted].mean(),
                "median": np.median(sums[counted]),
                "p95": np.quantile(sums[counted], 0.95),
            },
            abs=1e-6,
        )
        summary = next(line for line in printed if line.startswith(name))
        paper = EvaluationSettings.load().paper["box_a"][name]["mean"]
        assert summary.split()[1] == f"{found['mean']:.5f}"
        assert summary.split()[4:6] == [f"{paper:.5f}", f"{found['mean'] / paper:.2f}"]


def test_before_any_step_the_estimate_is_the_prototype(tmp_path: Path) -> None:
    model = KinematicModel.load("door")
    path = save_constants(tmp_path, "door", [0.1] * 7, [0.1] * 7)
    methods = run(path, "--samples", "10")["methods"]
    truth = [sample(model, 0, i, spawn_key=EVALUATION)[1] for i in range(10)]
    assert list(methods) == ["baseline", "kmn"]
    for method in methods.values():
        assert method["by_step"][0] == pytest.approx(np.abs(truth).sum(axis=1).mean())


def test_icp_is_compared_where_it_applies(tmp_path: Path) -> None:
    path = save_constants(tmp_path, "box_a", [0.0] * 2, [0.0] * 2)
    methods = run(path, "--samples", "3")["methods"]
    assert list(methods) == ["baseline", "kmn", "icp"]
    start, aligned = methods["icp"]["by_step"]
    assert start == methods["kmn"]["by_step"][0]
    assert aligned < 0.5 * start


def test_the_figures_of_a_tally_are_those_computed_by_hand() -> None:

    def estimates(cloud: NDArray[np.float32]) -> Iterator[NDArray[np.float64]]:
        yield np.zeros(2)
        yield np.array([0.1, -0.2])

    tally = Tally(BOX_A, Method(estimates, counted=1), steps=5)
    nothing = np.empty((0, 3), dtype=np.float32)
    for truth in ([0.1, -0.2], [0.1, 0.0], [0.4, -0.2]):
        tally.add(nothing, np.array(truth))
    figures = tally.summary()
    assert figures["by_step"] == pytest.approx([(0.3 + 0.1 + 0.6) / 3, (0.0 + 0.2 + 0.3) / 3])
    assert figures["mean"] == pytest.approx(0.5 / 3)
    assert figures["median"] == pytest.approx(0.2)
    assert figures["p95"] == pytest.approx(0.29)  # a tenth of the way from 0.3 back to 0.2
    assert figures["per_parameter"] == pytest.approx({"x": 0.1, "y": 0.2 / 3})


@settings(deadline=None)
@given(st.integers(-3, 3), st.floats(0.01, 0.5), st.floats(-0.7, 0.7))
def test_a_box_turned_by_quarter_turns_is_the_same_box(turns: int, off: float, yaw: float) -> None:
    """Turned by 90 degrees with length and width swapped only real errors are left."""
    truth = np.array([0.1, 0.2, yaw, 0.5, -0.3, 0.1])
    turned = truth + [off, 0.0, turns * np.pi / 2, 0.0, 0.0, -off]
    if turns % 2:
        turned[[3, 4]] = truth[[4, 3]]
    np.testing.assert_allclose(
        absolute_errors(BOX, turned, truth), [off, 0.0, 0.0, 0.0, 0.0, off], atol=1e-12
    )


@settings(deadline=None, max_examples=20)
@given(*[st.integers(0, 2**40), st.integers(0, 2**20)] * 2)
def test_no_sample_of_any_seed_is_one_that_trains(
    seed: int, index: int, training_seed: int, training_index: int
) -> None:
    _, values = sample(BOX_A, seed, index, spawn_key=EVALUATION)
    for number in (seed, index), (training_seed, training_index):
        assert not np.array_equal(values, sample(BOX_A, *number)[1])


def test_a_seed_gives_the_same_errors_again_and_another_seed_others(tmp_path: Path) -> None:
    path = save_constants(tmp_path, "box_b", [0.0] * 3, [0.0] * 3)
    first, again, other = (
        run(path, "--samples", "5", "--methods", "kmn", "--seed", seed)["methods"]["kmn"]["by_step"]
        for seed in ("7", "7", "8")
    )
    assert first == again != other


def test_samples_are_seen_as_in_training_unless_noise_is_given(tmp_path: Path) -> None:
    path = save_constants(tmp_path, "box", [0.0] * 6, [0.0] * 6, sensor=SENSOR)
    few = ("--samples", "3", "--methods", "kmn")
    trained, exact = run(path, *few), run(path, *few, "--noise", "none")
    assert (trained["noise"], exact["noise"]) == ("kinect", "none")
    # The start, above the cloud's centre, depends on what the sensor sees.
    steps = [result["methods"]["kmn"]["by_step"][0] for result in (trained, exact)]
    assert steps[0] != steps[1]
    assert run(save_constants(tmp_path, "box_a", [0.0] * 2, [0.0] * 2), *few)["noise"] == "none"


@pytest.mark.parametrize(
    ("more", "message"),
    [
        (["--weights", "nowhere.safetensors"], "no weights: 'nowhere.safetensors'"),
        (["--model", "box_b"], "trained for another model"),
        (["--model", "boat"], "'boat' is neither a file nor one of the shipped config/models"),
        (["--methods", "icp"], "icp does not apply to 'door'"),
        (["--methods", "magic"], "invalid choice: 'magic'"),
        (["--seed", "-1"], "-1 is not a whole number from 0"),
        (["--samples", "0"], "0 is not a whole number from 1"),
        (
            ["--json", "nowhere/result.json"],
            "nowhere/result.json is not a file in a folder that exists",
        ),
    ],
)
def test_bad_arguments_end_with_a_message(
    tmp_path: Path, more: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    path = save_constants(tmp_path, "door", [0.0] * 7, [0.0] * 7)
    with pytest.raises(SystemExit) as ending:
        main(["--model", "door", "--weights", str(path), "--samples", "2", *more])
    assert message in f"{ending.value} {capsys.readouterr().err}"


def test_ctrl_c_ends_it_without_a_traceback(tmp_path: Path) -> None:
    path = save_constants(tmp_path, "box_a", [0.0] * 2, [0.0] * 2)
    module = "kmn_perception.evaluation.evaluate"
    command = [sys.executable, "-m", module, "--model", "box_a", "--weights", str(path)]
    with subprocess.Popen(
        [*command, "--samples", "100000"], stderr=subprocess.PIPE, text=True
    ) as process:
        assert process.stderr is not None
        assert any("evaluate box_a" in line for line in process.stderr)
        process.send_signal(signal.SIGINT)
        _, rest = process.communicate(timeout=60)
    assert process.returncode != 0
    assert rest.endswith("evaluate: interrupted\n")
    assert "Traceback" not in rest


@pytest.mark.parametrize("name", ["box_a", "box_b", "box_c", "door"])
def test_the_papers_figures_are_consistent(name: str) -> None:
    """The table prints the sum over the parameters with five digits, each of them with four."""
    names = [parameter.name for parameter in KinematicModel.load(name).parameters]
    for figures in EvaluationSettings.load().paper[name].values():
        assert list(figures) == ["mean", *names]
        parts = sum(figures[parameter] for parameter in names)
        assert parts == pytest.approx(figures["mean"], abs=0.5e-4 * len(names) + 0.5e-5)
