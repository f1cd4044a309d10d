"""The training on walls with a tiny budget: it learns, resumes to the same, and refuses."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
import yaml

from kmn_perception.configuration import resources
from kmn_perception.configuration.section import ConfigurationError
from kmn_perception.doors.settings import DoorSettings
from kmn_perception.doors.view_cells import describe_cells
from kmn_perception.network import wall_weights
from kmn_perception.network.threads import use_one_thread
from kmn_perception.network.wall_network import CHANNELS, ROWS, Proposals, WallNetwork
from kmn_perception.training.run import Run, RunError
from kmn_perception.training.train_doors import arguments, settings_of, train
from kmn_perception.training.wall.augmentation import window
from kmn_perception.training.wall.fitting import Fitting
from kmn_perception.training.wall.losses import soft_targets
from kmn_perception.training.wall.samples import SCALE, Sample, is_validation
from kmn_perception.training.wall.scores import Scores
from kmn_perception.training.wall.settings import WallTrainingSettings
from kmn_perception.training.wall.shards import make_shards, read_shards
from kmn_perception.training.wall.targets import Target

SHIPPED = WallTrainingSettings.load("room_door")
DOORS = DoorSettings.load()
CELL = (0.04, 0.02)  # metres
STEADY = SHIPPED.augmentation._replace(
    mirror=0.0, invert=0.0, depth_alone=0.0, flush=0.0, noise=0.0, stretch=1.0, lift=0,
    weaken=SHIPPED.augmentation.weaken._replace(share=0.0),
)  # fmt: skip


@pytest.fixture(scope="module")
def config(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a file of settings for a training of seconds."""
    shipped = resources.find("config/training/wall", "room_door")
    values = yaml.safe_load(shipped.read_text(encoding="utf-8"))
    values["width"] = 16
    values["data"] |= {"rooms": 6, "shard": 2, "validation": 0.34}
    values["augmentation"]["columns"] = 96
    values["fit"] |= {"epochs": 12, "batch": 4, "learning_rate": 0.005}
    file = tmp_path_factory.mktemp("config") / "small.yaml"
    file.write_text(yaml.safe_dump(values), encoding="utf-8")
    return file


@pytest.fixture(scope="module")
def settings(config: Path) -> WallTrainingSettings:
    return WallTrainingSettings.load(config)


class Calls:
    """Tells at its n-th call, and later, that the run was interrupted."""

    def __init__(self, last: int) -> None:
        self.count, self.last = 0, last

    def __call__(self) -> bool:
        self.count += 1
        return self.count >= self.last


@pytest.fixture(scope="module")
def files(settings: WallTrainingSettings, tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Return the files of six rooms, rendered with an interruption in the fourth."""
    folder = tmp_path_factory.mktemp("run") / "data"
    with pytest.raises(KeyboardInterrupt):
        make_shards(folder, settings, DOORS, 1, Calls(4))
    (first,) = folder.iterdir()
    written = first.stat().st_mtime_ns
    rest = Calls(100)
    files = make_shards(folder, settings, DOORS, 1, rest)
    assert rest.count == 4  # the other rooms
    assert len(files) == 3
    assert first.stat().st_mtime_ns == written
    return files


def test_rooms_give_views_with_and_without_doors(
    files: list[Path], settings: WallTrainingSettings
) -> None:
    samples, held_out = read_shards(files, settings, DOORS)
    for sample in samples + held_out:
        assert sample.cells.shape[:2] == (CHANNELS, ROWS)
        assert sample.cells.shape[2] * CELL[1] > settings.data.min_length - CELL[1]
        assert np.abs(sample.cells.astype(int)).max() <= SCALE
    assert {sample.target.door for sample in samples} == {0.0, 1.0}


def test_the_share_of_rooms_is_held_out() -> None:
    rooms = sum(is_validation(i, SHIPPED.data) for i in range(10000))
    assert rooms == round(10000 * SHIPPED.data.validation)


class InterruptedRun(Run):
    """A run that is interrupted after so many steps."""

    steps = 7

    def checkpoint_is_due(self) -> bool:
        self.steps -= 1
        self.interrupted = self.steps == 0
        return super().checkpoint_is_due()


def fitting(
    files: list[Path], settings: WallTrainingSettings, folder: Path, kind: type[Run] = Run
) -> Fitting:
    use_one_thread()
    torch.manual_seed(settings.seed)
    network = WallNetwork(settings.width)
    return Fitting(
        network, *read_shards(files, settings, DOORS), settings, CELL, kind(folder, {}, 60.0)
    )


def test_a_few_steps_lower_the_loss_and_an_interruption_changes_nothing(
    files: list[Path], settings: WallTrainingSettings, tmp_path: Path
) -> None:
    whole = fitting(files, settings, tmp_path / "whole")
    whole.fit()
    losses = [sum(epoch["loss"].values()) for epoch in whole.state.epochs]
    assert len(losses) == settings.fit.epochs
    assert losses[-1] < 0.8 * losses[0]
    with pytest.raises(KeyboardInterrupt):
        fitting(files, settings, tmp_path / "parts", InterruptedRun).fit()
    resumed = fitting(files, settings, tmp_path / "parts")
    resumed.fit()
    assert resumed.state.step == whole.state.step
    for name, tensor in whole.network.state_dict().items():
        assert torch.equal(tensor, resumed.network.state_dict()[name]), name
    for a, b in zip(whole.state.epochs, resumed.state.epochs, strict=True):
        assert {**a, "seconds": 0} == {**b, "seconds": 0}


@pytest.fixture
def signals() -> Iterator[None]:
    handlers = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    yield
    for number, handler in handlers.items():
        signal.signal(number, handler)


@pytest.mark.usefixtures("signals")
def test_the_tool_goes_on_from_its_rooms_and_documents_what_it_made(
    files: list[Path], config: Path, tmp_path: Path
) -> None:
    out = tmp_path / "w.safetensors"
    run = files[0].parents[1]
    options = ["--out", str(out), "--config", str(config), "--run", str(run), "--epochs", "1"]
    train(arguments(options))
    weights = wall_weights.load(out, describe_cells(DOORS))
    assert weights.network.width == 16
    assert weights.metadata["model"] == DOORS.model
    assert weights.metadata["training"]["fit"]["epochs"] == 1
    assert weights.metadata["errors"]["of"]["edges"] > 0
    assert list((run / "curves").iterdir())
    with pytest.raises(RunError, match="holds a run with other settings"):
        train(arguments([*options, "--seed", "9"]))


def test_a_damaged_file_of_rooms_is_named(
    files: list[Path], settings: WallTrainingSettings, tmp_path: Path
) -> None:
    damaged = tmp_path / "rooms.npz"
    damaged.write_bytes(files[0].read_bytes()[:-1000])
    with pytest.raises(RunError, match=f"{damaged} is damaged .*remove it to render its rooms"):
        read_shards([damaged], settings, DOORS)


def test_too_few_rooms_are_refused(files: list[Path], settings: WallTrainingSettings) -> None:
    none = replace(settings, data=settings.data._replace(validation=0.001))
    with pytest.raises(RunError, match="and 0 to measure by; ask for more with --rooms"):
        read_shards(files, none, DOORS)


def test_the_command_line_takes_the_place_of_settings() -> None:
    options = arguments(["--out", "w", "--rooms", "50", "--epochs", "3", "--seed", "0"])
    changed = settings_of(options)
    assert (changed.data.rooms, changed.fit.epochs, changed.seed) == (50, 3, 0)
    assert changed.augmentation == SHIPPED.augmentation


def test_an_unknown_kind_of_room_is_refused(config: Path, tmp_path: Path) -> None:
    file = tmp_path / "wrong.yaml"
    file.write_text(config.read_text().replace("cupboard:", "castle:"), encoding="utf-8")
    with pytest.raises(ConfigurationError, match="'castle' is none of door, person"):
        WallTrainingSettings.load(file)


def marked(columns: int, target: Target) -> Sample:
    """Return a sample whose steps of grey to the right are 1 at the left, -1 at the right edge."""
    cells = np.zeros((CHANNELS, ROWS, columns), np.int8)
    cells[0, :, round(target.left)] = SCALE
    cells[0, :, round(target.right)] = -SCALE
    return Sample(cells, target)


@pytest.mark.parametrize("mirror", [0.0, 1.0])
@pytest.mark.parametrize("columns", [90, 400])
def test_windows_and_mirrors_take_the_target_along(mirror: float, columns: int) -> None:
    """A mirrored bright door in a dark wall stays one: its left edge is again a step up."""
    target = Target(1.0, 20.0, 60.0, 20.0, np.nan, 12.0, 37.0, 55.0, 1.0)
    sample, generator = marked(columns, target), np.random.default_rng(1)
    settings = STEADY._replace(mirror=mirror)
    for _ in range(20):
        cells, moved = window(sample, settings, generator)
        for column, step in ((moved.left, 1.0), (moved.right, -1.0)):
            if 0 <= column < settings.columns:
                assert cells[0, 3, int(column)] == step
        assert moved.right - moved.left == 40.0
        shown, hidden = moved.panel_left, moved.panel_right
        if mirror:
            shown, hidden = hidden, shown
        assert shown == (moved.right if mirror else moved.left)
        assert np.isnan(hidden)
        nearer = moved.right - moved.handle_column
        assert nearer == (5.0 if not mirror else 35.0)


def test_stretched_and_lifted_windows_take_the_target_along() -> None:
    target = Target(1.0, 80.0, 140.0, 80.0, 140.0, 12.0, 37.0, 132.0, 1.0)
    sample, generator = marked(300, target), np.random.default_rng(2)
    sample.cells[1, round(target.top)] = SCALE
    widths, tops = set(), set()
    for _ in range(20):
        cells, moved = window(sample, STEADY._replace(stretch=1.2, lift=1), generator)
        if moved.left < 0 or moved.right >= STEADY.columns:
            continue
        assert abs(int(cells[0, 3].argmax()) - moved.left) <= 1.0
        assert abs(int(cells[0, 3].argmin()) - moved.right) <= 1.0
        assert cells[1, int(moved.top), int(moved.left)] == pytest.approx(1.0)
        assert moved.top - moved.handle_row == target.top - target.handle_row
        widths.add(round(moved.right - moved.left))
        tops.add(moved.top)
    assert min(widths) < 57
    assert max(widths) > 63
    assert tops == {11.0, 12.0, 13.0}


def test_what_is_outside_of_a_window_is_not_to_be_found_there() -> None:
    spread = SHIPPED.target.spread
    soft = soft_targets(
        [Target(1.0, -5.0, 20.0, np.nan, 21.0, np.nan, 30.0, 80.0, 2.0)], 40, spread
    )
    assert soft.edges[0, 0, -1] == 1.0
    assert soft.edges[0, :, :-1].argmax(dim=1).tolist()[1::2] == [20, 21]
    assert soft.edges[0, 2, -1] == 1.0
    assert soft.top[0, -1] == 1.0
    assert soft.handle_known[0] == 0.0
    inside = soft_targets([Target(1.0, 2.0, 20.0, 2.0, 20.0, 11.0, 30.0, 17.0, 2.0)], 40, spread)
    place = inside.handle[0, :-1].reshape(3, ROWS, 40)
    np.testing.assert_array_equal(np.unravel_index(int(place.argmax()), place.shape), (2, 30, 17))
    for answer in (inside.edges[0, 0], inside.edges[0, 1], inside.top[0], inside.handle[0]):
        assert float(answer.sum()) == pytest.approx(1.0, abs=1e-5)
    missing = soft_targets([Target(0.0)], 40, spread)
    assert missing.edges[0, :, -1].tolist() == [1.0] * 4
    assert missing.handle[0, -1] == 1.0


@pytest.mark.parametrize(("off", "right"), [(0.0, True), (1.9, True), (-1.9, True), (2.4, False)])
def test_edges_count_within_4_cm(off: float, right: bool) -> None:
    at = np.zeros(51, np.float32)
    at[20] = 1.0
    handle = np.zeros((3, ROWS, 50), np.float32)
    handle[1, 30, 22] = 1.0
    top = np.full((ROWS, 50), -9.0, np.float32)
    top[12] = 9.0
    far = np.zeros(51, np.float32)
    far[40] = 1.0
    scores = Scores(SHIPPED.scores, CELL)
    target = Target(
        1.0, 20.0 + off, 40.0 - off, 20.0 + off, np.nan, 12.0 + off, 30.0, 22.0 + off, 1.0
    )
    edges = np.stack([at, far, at, far])
    scores.add(Proposals(edges, top, handle), target)
    share = 1.0 if right else 0.0
    near_top = abs(off) < 1.0
    assert scores.shares() == {
        "edges": share,
        "handle": 1.0,
        "no_panel_edges": 0.0,
        "panel_edges": share,
        "side": 1.0,
        "top": float(near_top),
    }
    other = Scores(SHIPPED.scores, CELL)
    other.add(Proposals(edges, top, handle), Target(0.0))
    assert other.shares() == {"no_edges": 0.0, "no_panel_edges": 0.0}
