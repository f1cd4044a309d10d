"""The experiment on labelled frames as a command, its baselines, and bad folders."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from kmn_perception.configuration.resources import share_directory
from kmn_perception.experiments.baselines import BASELINES
from kmn_perception.experiments.evaluate_frames import main
from kmn_perception.experiments.labelled_frame import FrameError, check_frames, read_frames
from kmn_perception.experiments.settings import ExperimentSettings
from kmn_perception.experiments.upright_box import UprightBox, errors, intersection_over_union

SHIPPED = share_directory() / "data" / "kinect_boxes"
SETTINGS = ExperimentSettings.load()
KEYS = (
    "frames", "objects", "found", "false_found", "yaw_error_deg", "size_error_m",
    "centre_error_m", "iou", "coverage95", "milliseconds", "baselines",
)  # fmt: skip


def _copy(folder: Path, *numbers: int) -> Path:
    for number in numbers:
        for kind in "dl":
            shutil.copy(SHIPPED / f"learn{number}_{kind}.png", folder)
    return folder


class Ended(NamedTuple):
    """How the program ended, and what it said."""

    code: Any
    stdout: str
    stderr: str


Evaluate = Callable[..., Ended]


@pytest.fixture
def evaluate(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Evaluate:
    """Return what runs the program with some arguments, in this process."""

    def run(*arguments: str | Path) -> Ended:
        monkeypatch.setattr(sys, "argv", ["evaluate_frames", *map(str, arguments)])
        try:
            code: Any = main()
        except SystemExit as ended:
            code = ended.code
        return Ended(code, *capsys.readouterr())

    return run


@pytest.mark.slow
def test_it_writes_statistics_and_pictures_with_the_baselines_beside(
    evaluate: Evaluate, tmp_path: Path
) -> None:
    frames, out = tmp_path / "frames", tmp_path / "pictures"
    frames.mkdir()
    done = evaluate(_copy(frames, 2, 14), "--json", tmp_path / "e.json", "--out", out)
    assert done.code == 0, done.stderr
    result = json.loads((tmp_path / "e.json").read_text())
    assert [key for key in result if key in KEYS] == [*KEYS]
    assert (result["frames"], result["objects"], result["less_visible"]["objects"]) == (2, 4, 1)
    assert result["found"] == 4
    assert result["false_found"] == 0
    assert 0.0 < result["yaw_error_deg"]["median"] < 1.5
    assert result["size_error_m"]["median"] < 0.005
    assert result["centre_error_m"]["median"] < 0.005
    assert result["iou"]["median"] > 0.85
    assert result["baselines"].keys() == BASELINES.keys()
    for baseline in result["baselines"].values():
        assert baseline["size_error_m"]["median"] > result["size_error_m"]["median"]
    assert "learn14 40" in done.stdout
    assert sorted(path.name for path in out.iterdir()) == [
        "all_frames.png", "frame_00.png", "frame_01.png",
    ]  # fmt: skip


@pytest.mark.slow
def test_a_frame_without_a_table_in_the_depth_counts_its_objects_as_not_found(
    evaluate: Evaluate, tmp_path: Path
) -> None:
    _copy(tmp_path, 0)
    depth = cv2.imread(str(tmp_path / "learn0_d.png"), cv2.IMREAD_UNCHANGED)
    assert depth is not None
    labels = cv2.imread(str(tmp_path / "learn0_l.png"), cv2.IMREAD_UNCHANGED)
    assert labels is not None
    table = np.argwhere(labels == 1)
    kept = table[np.random.default_rng(0).choice(len(table), 500, replace=False)]
    emptied = np.where(labels == 1, 0, depth)
    emptied[tuple(kept.T)] = depth[tuple(kept.T)]  # enough for the reference alone
    cv2.imwrite(str(tmp_path / "learn0_d.png"), emptied)
    done = evaluate(tmp_path, "--json", tmp_path / "e.json")
    assert done.code == 0, done.stderr
    result = json.loads((tmp_path / "e.json").read_text())
    assert (result["objects"], result["found"], result["false_found"]) == (1, 0, 0)
    assert result["yaw_error_deg"] == {"median": None, "p95": None}


def test_bad_folders_are_answered_with_what_was_expected(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "kmn_perception", "evaluate_frames", str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert "holds no file *_d.png" in done.stderr
    _copy(tmp_path, 3)
    (tmp_path / "learn3_l.png").unlink()
    with pytest.raises(FrameError, match="learn3_l.png is missing"):
        read_frames(tmp_path)
    cv2.imwrite(str(tmp_path / "learn3_l.png"), np.zeros((480, 640), dtype=np.uint16))
    with pytest.raises(FrameError, match="expected one channel of uint8"):
        read_frames(tmp_path)
    cv2.imwrite(str(tmp_path / "learn3_l.png"), np.zeros((240, 320), dtype=np.uint8))
    with pytest.raises(FrameError, match="labels of 320 x 240 pixels for a depth image of 640"):
        read_frames(tmp_path)
    cv2.imwrite(str(tmp_path / "learn3_l.png"), np.zeros((480, 640), dtype=np.uint8))
    with pytest.raises(FrameError, match="0 measured pixels are labelled 1, expected a table"):
        check_frames(read_frames(tmp_path), SETTINGS)


def _change(folder: Path, change: Callable[[NDArray[Any]], NDArray[Any]]) -> None:
    """Change the pictures of a frame."""
    for file in folder.glob("learn3_?.png"):
        picture = cv2.imread(str(file), cv2.IMREAD_UNCHANGED)
        assert picture is not None
        cv2.imwrite(str(file), change(picture))


@pytest.mark.parametrize("shape", ["coarser", "finer", "cropped"])
def test_frames_of_any_size_are_evaluated(evaluate: Evaluate, tmp_path: Path, shape: str) -> None:
    """A crop is of another shape than the camera's image, so that it needs a camera of its own."""
    _copy(tmp_path, 3)
    if shape == "cropped":
        _change(tmp_path, lambda picture: picture[40:, 60:])
        camera = (share_directory() / "config/cameras/kinect_v1.yaml").read_text()
        for old, new in (
            ("width: 640", "width: 580"), ("height: 480", "height: 440"),
            ("cx: 319.5", "cx: 259.5"), ("cy: 239.5", "cy: 199.5"),
        ):  # fmt: skip
            assert old in camera
            camera = camera.replace(old, new)
        (tmp_path / "camera.yaml").write_text(camera)
    elif shape == "coarser":
        _change(tmp_path, lambda picture: picture[::2, ::2])
    else:
        _change(tmp_path, lambda picture: picture.repeat(2, axis=0).repeat(2, axis=1))
    done = evaluate(tmp_path, "--json", tmp_path / "e.json", "--out", tmp_path / "pictures")
    assert done.code == 0, done.stderr
    result = json.loads((tmp_path / "e.json").read_text())
    assert (result["objects"], result["found"], result["false_found"]) == (2, 2, 0)
    assert result["size_error_m"]["median"] < 0.006


def test_frames_of_another_shape_without_a_camera_are_refused_with_both(
    evaluate: Evaluate, tmp_path: Path
) -> None:
    _change(_copy(tmp_path, 3), lambda picture: picture[:-30])
    done = evaluate(tmp_path)
    assert done.code == 1
    expected = "evaluate_frames: learn3: 640 x 450 pixels, expected the shape of 640 x 480, as"
    assert done.stderr.splitlines()[-1].startswith(expected)
    assert "camera.yaml" in done.stderr


@pytest.mark.parametrize(
    ("option", "path", "message"),
    [
        ("--json", ".", "argument --json: . is not a file in a folder that exists"),
        ("--out", "/proc/pictures", "argument --out: nothing can be written to /proc"),
        ("--out", str(SHIPPED / "learn3_d.png"), "argument --out: .*is a file"),
    ],
)
def test_what_cannot_be_written_is_refused_at_once(
    evaluate: Evaluate, option: str, path: str, message: str
) -> None:
    done = evaluate(option, path)
    assert done.code == 2
    assert re.search(message, done.stderr)


def test_frames_come_in_the_order_of_their_numbers(tmp_path: Path) -> None:
    names = [frame.name for frame in read_frames(_copy(tmp_path, 10, 2, 1))]
    assert names == ["learn1", "learn2", "learn10"]


def _surface(box: UprightBox) -> NDArray[np.float32]:
    """Draw points on all faces of a box."""
    random = np.random.default_rng(0)
    local, axis = random.uniform(-0.5, 0.5, size=(4000, 3)), random.integers(3, size=4000)
    rows = np.arange(len(local))
    local[rows, axis] = np.sign(local[rows, axis]) / 2.0
    cube = box.unit_cube
    return (local @ cube[:3, :3].T + cube[:3, 3]).astype(np.float32)


@pytest.mark.parametrize("name", list(BASELINES))
def test_baselines_find_a_box_that_is_seen_from_all_sides(name: str) -> None:
    box = UprightBox(np.array([0.1, -0.2, 0.1]), np.array([0.3, 0.15, 0.2]), 0.4)
    found = BASELINES[name](_surface(box), SETTINGS.baselines)
    off = errors(found, box)
    assert np.degrees(off.yaw) < 0.5
    assert off.size.max() < 0.003
    assert intersection_over_union(found, box) > 0.97
