"""The experiment on doors as a command, on rendered rooms, and bad folders."""

from __future__ import annotations

import contextlib
import io
import json
import shutil
from pathlib import Path
from typing import Any, NamedTuple

import cv2
import numpy as np
import pytest

from kmn_perception.configuration.section import ConfigurationError
from kmn_perception.doors.settings import DoorSettings
from kmn_perception.evaluation.doors.errors import UNITS
from kmn_perception.evaluation.doors.label import SIDES, describe_camera
from kmn_perception.experiments.doors.experiment import WITH_COLOUR, DoorExperiment
from kmn_perception.experiments.doors.frames import FrameFiles, find_frames
from kmn_perception.experiments.doors.statistics import statistics
from kmn_perception.experiments.evaluate_doors import main
from kmn_perception.experiments.labelled_frame import FrameError
from kmn_perception.experiments.settings import ExperimentSettings
from kmn_perception.rooms import render_rooms

DOORS = ("door_1007", "door_1023")
NEGATIVE = "brick_0"
SETTINGS = ExperimentSettings.load()
FOUND = ("OK", "HANDLE_NOT_SEEN")
BLOCK = (
    "frames", "found", "ok_and_wrong", "edge_mm", "width_mm", "top_mm", "yaw_deg", "handle_up_mm",
    "handle_along_mm", "opening_deg", "coverage95", "milliseconds",
)  # fmt: skip


class Run(NamedTuple):
    """A folder of frames, what was written about it, and what was printed."""

    folder: Path
    result: dict[str, Any]
    pictures: Path
    printed: str


@pytest.fixture(scope="module")
def rooms(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("rooms")
    out = ["--out", str(folder)]
    for name in DOORS:
        assert render_rooms.main([*out, "--seed", name.split("_")[1], "--count", "1"]) == 0
    assert render_rooms.main([*out, "--kind", "brick", "--count", "1"]) == 0
    return folder


@pytest.fixture(scope="module")
def run(rooms: Path, tmp_path_factory: pytest.TempPathFactory) -> Run:
    out = tmp_path_factory.mktemp("results")
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        command = [str(rooms), "--json", str(out / "r.json"), "--out", str(out / "pictures")]
        main(command)
    result = json.loads((out / "r.json").read_text())
    return Run(rooms, result, out / "pictures", printed.getvalue())


def _frame(rooms: Path, name: str, depth: str = "calibrated") -> FrameFiles:
    frames = find_frames(rooms, depth, describe_camera("d455"))
    return next(frame for frame in frames if frame.name == name)


def _copy(rooms: Path, folder: Path, *endings: str) -> Path:
    for ending in endings:
        shutil.copy(rooms / f"{DOORS[0]}{ending}", folder)
    return folder


def test_the_statistics_have_their_keys(run: Run) -> None:
    result = run.result
    assert [key for key in result if key in BLOCK] == [*BLOCK]
    assert set(result) - set(BLOCK) == {
        "negatives", "negatives_ok", "baselines", "depth_alone", "without_network", "per_frame",
    }  # fmt: skip
    for mode in ("depth_alone", "without_network"):
        assert set(result[mode]) == {*BLOCK, "negatives", "negatives_ok"}
    assert set(result["baselines"]) == {"depth_steps", "grey_lines", "masked_pipeline"}
    for key in BLOCK[3:10]:
        assert set(result[key]) == {"median", "p95"}


def test_doors_and_what_is_no_door_are_counted_apart(run: Run) -> None:
    result, frames = run.result, run.result["per_frame"]
    assert (result["frames"], result["negatives"]) == (3, 1)
    assert [frame["door"] for frame in frames.values()] == [False, True, True]
    for block, mode in ((result, WITH_COLOUR), (result["depth_alone"], "depth_alone")):
        said = {name: frame[mode] for name, frame in frames.items()}
        found = {name for name, frame in said.items() if frame["status"] in FOUND}
        assert block["found"] == len(found - {NEGATIVE})
        assert block["negatives_ok"] == len(found & {NEGATIVE})
        assert block["ok_and_wrong"] == sum(frame["ok_and_wrong"] for frame in said.values())
        assert {name for name, frame in said.items() if "errors" in frame} == found - {NEGATIVE}
    assert result["found"] >= 1
    assert frames[NEGATIVE][WITH_COLOUR]["reason"]


def test_quantiles_are_those_of_the_frames(run: Run) -> None:
    frames = [run.result["per_frame"][name][WITH_COLOUR].get("errors", {}) for name in DOORS]
    edges = [abs(frame[f"{side}_mm"]["error"]) for frame in frames if frame for side in SIDES]
    assert edges
    assert run.result["edge_mm"]["median"] == pytest.approx(np.median(edges), abs=2e-3)
    assert run.result["edge_mm"]["p95"] == pytest.approx(np.percentile(edges, 95), abs=2e-3)


def test_every_frame_is_printed_and_drawn(run: Run) -> None:
    lines = run.printed.splitlines()
    for name in (*DOORS, NEGATIVE):
        assert sum(line.startswith(name) for line in lines) == 3  # with and without network, colour
    reason = run.result["per_frame"][NEGATIVE][WITH_COLOUR]["reason"]
    assert any(line.startswith(NEGATIVE) and line.endswith(reason) for line in lines)
    names = {path.name for path in run.pictures.iterdir()}
    assert names == {f"{name}.png" for name in (*DOORS, NEGATIVE, "all_frames")}
    picture = cv2.imread(str(run.pictures / f"{DOORS[0]}.png"))
    assert picture is not None
    assert picture.shape == (960, 1280, 3)


@pytest.fixture(scope="module")
def experiment() -> DoorExperiment:
    return DoorExperiment(SETTINGS, DoorSettings.load())


def test_frames_without_labels_are_negatives_with_the_same_estimates(
    run: Run, experiment: DoorExperiment, tmp_path: Path
) -> None:
    _copy(run.folder, tmp_path, "_d.png", "_colour.jpg")
    result = statistics([experiment.run(_frame(tmp_path, DOORS[0]).read())], SETTINGS)
    before, after = (r["per_frame"][DOORS[0]]["depth_alone"] for r in (run.result, result))
    assert (after["status"], after["reason"]) == (before["status"], before["reason"])
    assert (result["frames"], result["negatives"], result["found"]) == (1, 1, 0)
    assert result["ok_and_wrong"] == result["negatives_ok"] == 1
    assert result["edge_mm"] == {"median": None, "p95": None}


def test_delivered_depth_is_less_sure(run: Run, experiment: DoorExperiment, tmp_path: Path) -> None:
    _copy(run.folder, tmp_path, ".json", "_colour.jpg", "_d.png")
    with pytest.raises(FrameError, match=r"_raw\.png is missing, expected with --depth raw"):
        find_frames(tmp_path, "raw", describe_camera("d455"))
    shutil.copy(tmp_path / f"{DOORS[0]}_d.png", tmp_path / f"{DOORS[0]}_raw.png")
    distance = list(UNITS).index("distance")
    stated = []
    for depth in ("calibrated", "raw"):
        outcome = experiment.run(_frame(tmp_path, DOORS[0], depth).read()).outcomes[WITH_COLOUR]
        assert outcome.errors is not None
        stated.append(outcome.errors.stated[distance])
    assert stated[1] > 3.0 * stated[0]


def test_calibrated_colour_lies_on_the_depth(rooms: Path, tmp_path: Path) -> None:
    _copy(rooms, tmp_path, ".json", "_d.png")
    name = tmp_path / DOORS[0]
    shutil.copy(f"{name}_d.png", f"{name}_raw.png")
    colour = np.zeros((480, 640, 3), np.uint8)
    colour[200, 300] = 255
    cv2.imwrite(f"{name}_colour.jpg", cv2.GaussianBlur(colour, (0, 0), 4.0) * 60)
    label = json.loads(Path(f"{name}.json").read_text())
    label["registration"] = {"depth_px_minus_undistorted_colour_px": [-2.25, 1.5]}
    Path(f"{name}.json").write_text(json.dumps(label))
    for depth, place in (("calibrated", (297.75, 201.5)), ("raw", (300.0, 200.0))):
        grey = _frame(tmp_path, DOORS[0], depth).read().grey
        assert grey is not None
        spot = cv2.moments(grey)
        assert (spot["m10"] / spot["m00"], spot["m01"] / spot["m00"]) == pytest.approx(
            place, abs=0.1
        )
    label["registration"] = {"depth_px_minus_undistorted_colour_px": [-2.25]}
    Path(f"{name}.json").write_text(json.dumps(label))
    with pytest.raises(ConfigurationError, match="must be 2 numbers"):
        _frame(tmp_path, DOORS[0])


def test_bad_folders_are_answered_with_what_was_expected(rooms: Path, tmp_path: Path) -> None:
    camera = describe_camera("d455")
    with pytest.raises(FrameError, match="missing cannot be read: No such file"):
        find_frames(tmp_path / "missing", "calibrated", camera)
    with pytest.raises(FrameError, match=r"holds no file \*_d\.png or \*_raw\.png"):
        find_frames(tmp_path, "calibrated", camera)
    _copy(rooms, tmp_path, ".json", "_d.png", "_colour.jpg")
    image = cv2.imread(str(rooms / f"{DOORS[0]}_d.png"), cv2.IMREAD_UNCHANGED)
    assert image is not None
    cv2.imwrite(str(tmp_path / f"{DOORS[0]}_d.png"), image[::2, ::2])
    expected = f"{DOORS[0]}_d.png: 320 x 240 pixels, expected the 640 x 480 of its intrinsics"
    with pytest.raises(FrameError, match=expected):
        _frame(tmp_path, DOORS[0]).read()
    cv2.imwrite(str(tmp_path / f"{DOORS[0]}_d.png"), image.astype(np.uint8))
    with pytest.raises(FrameError, match="expected one channel of uint16"):
        _frame(tmp_path, DOORS[0]).read()
    cv2.imwrite(str(tmp_path / f"{DOORS[0]}_d.png"), image)
    (tmp_path / f"{DOORS[0]}_colour.jpg").write_text("no picture")
    with pytest.raises(FrameError, match=r"_colour\.jpg is not a picture"):
        _frame(tmp_path, DOORS[0]).read()


@pytest.mark.parametrize(
    ("key", "message"),
    [
        (("intrinsics", "K"), "intrinsics: 'K' must be rows of 3 numbers"),
        (("reference", "metric", "up"), "metric: 'up' must be 3 numbers, found None"),
        (("reference", "metric", "panel_plane"), "panel_plane: 'normal_towards_camera' must be"),
        (("reference",), "reference: metric"),
    ],
)
def test_a_label_without_a_key_is_refused_with_its_place(
    rooms: Path, tmp_path: Path, key: tuple[str, ...], message: str
) -> None:
    _copy(rooms, tmp_path, ".json", "_d.png")
    file = tmp_path / f"{DOORS[0]}.json"
    label = json.loads(file.read_text())
    place = label
    for name in key[:-1]:
        place = place[name]
    del place[key[-1]]
    file.write_text(json.dumps(label))
    with pytest.raises(ConfigurationError, match=message):
        _frame(tmp_path, DOORS[0])


def test_what_is_no_json_is_said(rooms: Path, tmp_path: Path) -> None:
    _copy(rooms, tmp_path, "_d.png")
    (tmp_path / f"{DOORS[0]}.json").write_text("{")
    with pytest.raises(SystemExit, match=rf"evaluate_doors: {DOORS[0]}\.json: not JSON"):
        main([str(tmp_path)])


@pytest.mark.parametrize(
    ("option", "path", "message"),
    [
        ("--json", ".", "argument --json: . is not a file in a folder that exists"),
        ("--out", "/proc/pictures", "argument --out: nothing can be written to /proc"),
    ],
)
def test_what_cannot_be_written_is_refused_at_once(
    option: str, path: str, message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit, match="2"):
        main(["folder", option, path])
    assert message in capsys.readouterr().err
