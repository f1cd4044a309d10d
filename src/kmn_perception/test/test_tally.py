"""Errors, their statistics, and the errors that the paper reports."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from kmn_perception.configuration import resources
from kmn_perception.configuration.section import ConfigurationError
from kmn_perception.evaluation.comparison import Measurement
from kmn_perception.evaluation.settings import EvaluationSettings
from kmn_perception.evaluation.tally import Tally
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.network.errors import absolute_errors

BOX, BOX_A = KinematicModel.load("box"), KinematicModel.load("box_a")
SETTINGS = EvaluationSettings.load()


def test_the_figures_of_a_tally_are_those_computed_by_hand() -> None:
    tally = Tally(BOX_A, 1, dataclasses.replace(SETTINGS, visible_bins=(0.0, 0.5, 0.999, 1.0)))
    start = np.array([[0.2, 0.1], [0.1, 0.0], [0.3, 0.3], [0.0, 0.0]])
    results = np.array([[0.0, 0.0], [0.0, 0.2], [0.3, 0.0], [0.1, 0.5]])
    for visible, *errors, covered in zip(
        [1.0, 0.999, 0.5, 0.4], start, results, [True, True, False, True], strict=True
    ):
        tally.add(visible, Measurement(np.stack(errors), 0.1, covered))
    statistics = tally.summary()
    assert statistics["samples"] == 4
    assert statistics["by_step"] == pytest.approx([0.25, 0.275])
    assert statistics["by_step_std"][1] == pytest.approx(np.std([0.0, 0.2, 0.3, 0.6]))
    assert statistics["mean"] == pytest.approx(0.275)
    assert statistics["median"] == pytest.approx(0.25)
    assert statistics["p95"] == pytest.approx(0.555)  # 15 % of the way from 0.6 back to 0.3
    assert statistics["per_parameter"] == pytest.approx({"x": 0.1, "y": 0.175})
    assert (statistics["best"], statistics["worst"]) == ([0, 1, 2], [3, 2, 1])
    assert statistics["coverage95"] == 0.75
    assert statistics["milliseconds"] == pytest.approx(100.0)
    bins = [
        [part[key] for key in ("samples", "mean")] for part in statistics["by_visible_fraction"]
    ]
    assert bins == [[1, pytest.approx(0.6)], [1, pytest.approx(0.3)], [2, pytest.approx(0.1)]]


def test_an_empty_bin_has_no_errors() -> None:
    tally = Tally(BOX_A, 0, SETTINGS)
    tally.add(1.0, Measurement(np.zeros((1, 2)), 0.1, None))
    statistics = tally.summary()
    assert statistics["by_visible_fraction"][0]["mean"] is None
    assert "coverage95" not in statistics


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


@pytest.mark.parametrize("name", ["box_a", "box_b", "box_c", "door"])
def test_the_errors_of_the_paper_are_consistent(name: str) -> None:
    """The table prints the sum over the parameters with five digits, each of them with four."""
    names = [parameter.name for parameter in KinematicModel.load(name).parameters]
    for errors in SETTINGS.paper[name].values():
        assert list(errors) == ["mean", *names]
        parts = sum(errors[parameter] for parameter in names)
        assert parts == pytest.approx(errors["mean"], abs=0.5e-4 * len(names) + 0.5e-5)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"shown_steps": 3}, r"'shown_steps' must be 5 \('steps'\) or more, found 3"),
        ({"visible_bins": [0, 0.9, 0.5, 1]}, "'visible_bins' is wrong: they must rise from 0 to 1"),
        ({"icp": {"iterations": 100}}, "evaluation.yaml: icp: key 'tolerance' is missing"),
    ],
)
def test_wrong_settings_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, change: dict[str, object], message: str
) -> None:
    file = tmp_path / "config" / "evaluation.yaml"
    file.parent.mkdir()
    known = yaml.safe_load((resources.share_directory() / "config/evaluation.yaml").read_text())
    file.write_text(yaml.safe_dump(known | change))
    monkeypatch.setattr(resources, "share_directory", lambda: tmp_path)
    with pytest.raises(ConfigurationError, match=message):
        EvaluationSettings.load()
