"""The results: every file is written and mentioned, and nothing is evaluated twice."""

from __future__ import annotations

import json
import re
from pathlib import Path

import cv2
import numpy as np
import pytest

from kmn_perception.evaluation.comparison import Request
from kmn_perception.evaluation.page import markdown
from kmn_perception.evaluation.plots.training import smooth
from kmn_perception.evaluation.results import main, result_of
from kmn_perception.evaluation.settings import EvaluationSettings

JSON_FILES = {"box_a_none.json", "box_a_mm.json", "box_a_kinect.json"}
PLOTS = {"predictions.png", "samples_box_a.png", "training.png"}


def test_the_page_shows_what_was_evaluated(tmp_path: Path) -> None:
    main(["--out", str(tmp_path), "--samples", "4", "--models", "box_a"])
    assert {file.name for file in tmp_path.iterdir()} == JSON_FILES | PLOTS | {"README.md"}
    results = {name: json.loads((tmp_path / name).read_text()) for name in JSON_FILES}
    page = (tmp_path / "README.md").read_text()
    assert set(re.findall(r"\]\((\w+\.png)\)", page)) == PLOTS
    assert "`./run kmn_perception results --samples 4 --seed 0 --models box_a`" in page
    for name, result in results.items():
        assert result["noise"] == name.removesuffix(".json").split("_")[-1]
        assert all(digits in page for digits in result["weights"].values())
    overview = page.split("## ")[1].splitlines()
    exact = results["box_a_none.json"]["methods"]["kmn_paper"]["mean"]
    assert any(f"| `kmn_paper` | {exact:.5f} (0.00142) |" in line for line in overview)
    for plot in PLOTS:
        image = cv2.imread(str(tmp_path / plot))
        assert image is not None and min(image.shape[:2]) > 200
        assert image.std() > 5.0
        assert (tmp_path / plot).stat().st_size < 200_000


def test_what_was_evaluated_is_taken_over_unless_something_has_changed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file, few = tmp_path / "box_a.json", ("information_limit",)

    def evaluated(request: Request, samples: int = 2, anew: bool = False) -> bool:
        result = result_of(request, samples, 1, file, anew, EvaluationSettings.load())
        assert result == json.loads(file.read_text())
        return "taken over" not in capsys.readouterr().err

    assert evaluated(Request("box_a", 0, methods=few))
    assert not evaluated(Request("box_a", 0, methods=few))
    assert evaluated(Request("box_a", 0, methods=few), anew=True)
    assert evaluated(Request("box_a", 0, methods=few), samples=3)
    assert evaluated(Request("box_a", 1, methods=few), samples=3)
    assert evaluated(Request("box_a", 1, "mm", methods=few), samples=3)
    for key, other in (("weights", {"paper": "0" * 12}), ("configuration", "0" * 12)):
        file.write_text(json.dumps(json.loads(file.read_text()) | {key: other}))
        assert evaluated(Request("box_a", 1, "mm", methods=few), samples=3)
    file.write_text(file.read_text()[:100])
    assert evaluated(Request("box_a", 1, "mm", methods=few), samples=3)


def test_a_folder_that_cannot_be_written_is_refused_before_the_work(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "file").touch()
    for path, message in (("/proc/results", "nothing can be"), (tmp_path / "file", "is a file")):
        with pytest.raises(SystemExit):
            main(["--out", str(path)])
        assert message in capsys.readouterr().err


def test_a_smoothed_power_law_is_the_same_and_a_peak_is_spread() -> None:
    """Means are of logarithms, of which an exponential has a straight line."""
    falling = np.exp(-np.linspace(0.0, 3.0, 60))
    np.testing.assert_allclose(smooth(falling)[4:-4], falling[4:-4])
    peak = np.ones(60)
    peak[30] = np.e**9
    np.testing.assert_allclose(smooth(peak)[26:35], np.e)  # 4 neighbours to either side
    np.testing.assert_allclose(smooth(peak)[:26], 1.0)


def test_a_table_has_a_head_and_a_line_for_each_row() -> None:
    assert markdown([["a", "b"], ["1", "2"]]) == "| a | b |\n| --- | --- |\n| 1 | 2 |"


@pytest.mark.parametrize(
    ("more", "message"),
    [
        (["--models", "boat"], "invalid choice: 'boat'"),
        (["--samples", "0"], "0 is not a whole number from 1"),
    ],
)
def test_bad_arguments_end_with_a_message(
    tmp_path: Path, more: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ending:
        main(["--out", str(tmp_path), *more])
    assert message in f"{ending.value} {capsys.readouterr().err}"
