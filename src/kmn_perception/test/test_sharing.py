"""Shares of an experiment: of processes and machines, resumed, joined, and refused."""

from __future__ import annotations

import argparse
import json
import math
import os
import signal
import subprocess
import sys
import time
from enum import Enum
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray

from kmn_perception.experiments.merge import COMMANDS
from kmn_perception.experiments.merge import main as merge_main
from kmn_perception.rooms import render_rooms
from kmn_perception.sharing.experiment import ExperimentCommand, SharedExperiment
from kmn_perception.sharing.merge import merge
from kmn_perception.sharing.plain import from_plain, to_plain
from kmn_perception.sharing.processes import in_order

VARYING = ("milliseconds", "seconds", "date")  # from run to run
TINY = {
    "objects": "evaluate --model box_a --samples 5 --methods kmn_paper information_limit",
    "rooms": "evaluate --model room_door --samples 2 --methods depth_alone --seed 3",
    "states": "evaluate --model drawer --states slide=-0.1 slide=0 --samples 2",
    "models": "evaluate_models --models lid,drawer --samples 1",
    "frames": "evaluate_doors FOLDER",
}
BY_NAME = {command.name: command for command in COMMANDS}


class Parity(Enum):
    """What a number is."""

    EVEN = "even"
    ODD = "odd"


class Square(NamedTuple):
    """What is measured of a number."""

    parity: Parity
    powers: NDArray[np.float64]
    root: float | None
    parts: tuple[tuple[int, str], ...] = ()


def square(offset: int, number: int) -> Square:
    """Return what is measured of a number; three kills its process, which has others beside it."""
    if offset == 13 and number == 3:
        os.kill(os.getpid(), signal.SIGKILL)
    powers = np.array([number / 3.0, math.nan, -math.inf, 1e-300])
    root = math.sqrt(number) if number else None
    return Square(Parity.ODD if number % 2 else Parity.EVEN, powers, root, ((number, "x"),))


def squaring(offset: int) -> Any:
    """Return what measures a number."""
    return partial(square, offset)


def parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="squares")
    parser.add_argument("--count", type=int, default=7)
    parser.add_argument("--offset", type=int, default=0)
    parser.add_argument("--picture", help="an output")
    return parser


def prepare(options: argparse.Namespace) -> SharedExperiment[Square]:
    def conclude(found: list[Square]) -> tuple[str, Any]:
        return f"{len(found)} squares", to_plain(found)

    make = partial(squaring, options.offset)
    return SharedExperiment("squares", "numbers", options.count, Square, make, conclude)


SQUARES = ExperimentCommand("kmn_test", "squares", parser, prepare, (KeyError,), ("picture",))
OTHERS = ExperimentCommand("kmn_test", "others", parser, prepare, ())


def steady(result: Any) -> Any:
    """Return a result without what varies."""
    if isinstance(result, dict):
        return {key: steady(value) for key, value in result.items() if key not in VARYING}
    return [steady(value) for value in result] if isinstance(result, list) else result


def run(command: ExperimentCommand, *words: str | Path) -> None:
    command.start([str(word) for word in words])


@pytest.fixture
def records(tmp_path: Path) -> list[Path]:
    """Return the records of the squares' two shards."""
    files = [tmp_path / f"{i}.jsonl" for i in (0, 1)]
    for i, file in enumerate(files):
        run(SQUARES, "--shard", f"{i}/2", "--records", file)
    return files


@pytest.mark.parametrize("name", TINY)
def test_shards_are_joined_to_what_one_run_gives(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    program, *options = TINY[name].replace("FOLDER", str(tmp_path / "rooms")).split()
    if name == "frames":
        shown = ["--out", str(tmp_path / "rooms"), "--seed", "1007"]
        for shard in ("0/2", "1/2", "0/1"):  # and nothing is left for the whole
            assert render_rooms.main([*shown, "--count", "2", "--shard", shard]) == 0
        assert render_rooms.main([*shown, "--count", "1", "--sensor", "none"]) == 1
        assert "rendered with other options" in capsys.readouterr().err
    one, two = tmp_path / "one.json", tmp_path / "two.json"
    files = [tmp_path / f"{i}.jsonl" for i in (0, 1)]
    run(BY_NAME[program], *options, "--jobs", "1", "--json", one)
    table = capsys.readouterr().out
    for i, file in enumerate(files):
        run(BY_NAME[program], *options, "--jobs", "1", "--shard", f"{i}/2", "--records", file)
    capsys.readouterr()
    merge_main([*map(str, files), "--json", str(two)])
    assert len(capsys.readouterr().out.splitlines()) == len(table.splitlines())
    whole, joined = (steady(json.loads(file.read_text())) for file in (one, two))
    assert joined == whole


@pytest.mark.slow
def test_a_killed_shard_goes_on_where_it_was(tmp_path: Path) -> None:
    file, whole = tmp_path / "killed.jsonl", tmp_path / "whole.json"
    program, *options = TINY["objects"].replace("--samples 5", "--samples 150").split()
    command = [sys.executable, "-m", "kmn_perception", program, *options, "--records", str(file)]
    with subprocess.Popen([*command, "--jobs", "2"], stderr=subprocess.DEVNULL) as process:
        deadline = time.monotonic() + 100.0
        while not file.exists() or file.read_bytes().count(b"\n") < 20:
            assert process.poll() is None and time.monotonic() < deadline
            time.sleep(0.05)
        process.kill()
    there = file.read_bytes()
    assert 20 <= there.count(b"\n") < 151
    file.write_bytes(there + b'{"item": 3, "res')  # as if it had been killed while writing
    run(BY_NAME[program], *options, "--records", file, "--jobs", "1", "--json", whole)
    assert file.read_bytes().startswith(there[: there.rindex(b"\n") + 1])
    assert file.read_bytes().count(b"\n") == 151
    one = tmp_path / "one.json"
    run(BY_NAME[program], *options, "--jobs", "1", "--json", one)
    assert steady(json.loads(whole.read_text())) == steady(json.loads(one.read_text()))


def test_a_shard_of_other_options_or_of_other_files_is_refused(
    records: list[Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    first = ("--shard", "0/2", "--records", records[0])
    before = records[0].read_bytes()
    for more, message in (
        (("--offset", "1"), "is of another run: offset 0, expected 1"),
        (("--count", "9"), "is of another run: items 7, expected 9"),
        (("--shard", "1/2"), "is of shard 0/2, expected 1/2"),
    ):
        with pytest.raises(SystemExit, match=message):
            run(SQUARES, *first, *more)
    with pytest.raises(SystemExit, match="command kmn_test squares, expected kmn_test others"):
        run(OTHERS, *first)
    monkeypatch.setattr("kmn_perception.sharing.experiment.shipped_hash", lambda: "0" * 12)
    with pytest.raises(SystemExit, match="another run: shipped files .*, expected 000000000000"):
        run(SQUARES, *first)
    assert records[0].read_bytes() == before
    monkeypatch.undo()
    run(SQUARES, *first, "--picture", "on which nothing depends")
    assert records[0].read_bytes() == before


@pytest.mark.parametrize(
    ("line", "text", "message"),
    [
        (0, b"weights", "is no file of records"),
        (0, b'{"format": 1}', "is no file of records"),
        (2, b'{"item": 2, "result"', "is damaged at line 3"),
        (2, b'{"item": 4, "result": {}}', "is damaged at line 3 .item 4 does not follow here"),
        (2, b'{"item": 2, "result": {"parity": "NONE"}}', "is no Square"),
    ],
)
def test_damaged_records_are_refused_and_left_as_they_are(
    records: list[Path], line: int, text: bytes, message: str
) -> None:
    lines = records[0].read_bytes().splitlines(keepends=True)
    lines[line] = text + b"\n"
    records[0].write_bytes(b"".join(lines))
    with pytest.raises(SystemExit, match=message):
        run(SQUARES, "--shard", "0/2", "--records", records[0])
    with pytest.raises(SystemExit, match=f"merge: .*{message}"):
        merge([SQUARES], [str(file) for file in records])
    assert records[0].read_bytes() == b"".join(lines)


def test_only_all_shards_of_one_run_are_joined(records: list[Path], tmp_path: Path) -> None:
    other = tmp_path / "other.jsonl"
    run(SQUARES, "--shard", "1/2", "--records", other, "--offset", "2")
    short = tmp_path / "short.jsonl"
    short.write_bytes(b"".join(records[1].read_bytes().splitlines(keepends=True)[:-1]))
    for files, message in (
        ([records[0]], "each shard of 2 must be there once, see 1/2"),
        ([*records, records[1]], "each shard of 2 must be there once, see 1/2"),
        ([records[0], other], "is of another run: offset 2, expected 0"),
        ([records[0], short], "shard 1/2 is not at its end: item 5 of 7 is missing"),
        ([tmp_path / "none.jsonl"], "No such file"),
    ):
        with pytest.raises(SystemExit, match=message):
            merge([SQUARES], [str(file) for file in files])
    with pytest.raises(SystemExit, match="is of 'kmn_test squares'; joined here are: kmn_test oth"):
        merge([OTHERS], [str(file) for file in records])


def test_a_heading_names_no_file_to_write(records: list[Path], tmp_path: Path) -> None:
    """Who joins foreign records decides what is written, whatever their first line says."""
    victim, result = tmp_path / "victim", tmp_path / "result.json"
    heading, *rest = records[0].read_bytes().splitlines(keepends=True)
    hostile = json.loads(heading)
    hostile["arguments"] += ["--json", str(victim), "--records", str(victim)]
    records[0].write_bytes(json.dumps(hostile).encode() + b"\n" + b"".join(rest))
    merge([SQUARES], [*map(str, records), "--json", str(result)])
    assert not victim.exists()
    expected = to_plain([square(0, i) for i in range(7)])
    assert repr(json.loads(result.read_text())) == repr(expected)  # also NaN


def test_joined_records_are_those_of_the_whole(records: list[Path], tmp_path: Path) -> None:
    joined, whole = tmp_path / "joined.jsonl", tmp_path / "whole.jsonl"
    merge([SQUARES], [*map(str, records), "--records", str(joined)])
    run(SQUARES, "--records", whole)
    assert joined.read_bytes().splitlines()[1:] == whole.read_bytes().splitlines()[1:]
    run(SQUARES, "--records", joined)  # is at its end


@pytest.mark.parametrize("shard", ["2/2", "-1/2", "1", "0/0", "a/b"])
def test_what_is_no_shard_is_said(shard: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit, match="2"):
        SQUARES.parse([f"--shard={shard}", "--records", "x.jsonl"])
    assert f"{shard} is not I/N with 0 <= I < N" in capsys.readouterr().err


def test_a_shard_needs_a_file(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit, match="2"):
        SQUARES.parse(["--shard", "0/2"])
    assert "--shard needs --records" in capsys.readouterr().err


def test_a_killed_process_is_said(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit, match="squares: one of 2 processes was killed"):
        run(SQUARES, "--offset", "13", "--jobs", "2")


class Opened:
    """A context that says in a file when it is left."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def __enter__(self) -> Opened:
        return self

    def __exit__(self, *exception: object) -> None:
        (self.folder / f"{os.getpid()}.left").touch()

    def __call__(self, number: int) -> int:
        return os.getpid()


@pytest.mark.parametrize("jobs", [1, 2])
def test_every_process_leaves_its_context(jobs: int, tmp_path: Path) -> None:
    processes = set(in_order(partial(Opened, tmp_path), range(20), jobs))
    assert {file.stem for file in tmp_path.iterdir()} >= {str(pid) for pid in processes}
    assert (os.getpid() in processes) == (jobs == 1)


def test_values_come_back_as_they_were() -> None:
    for number in (0, 5):
        value = square(0, number)
        again = from_plain(Square, json.loads(json.dumps(to_plain(value))))
        assert again.parity is value.parity
        np.testing.assert_array_equal(again.powers, value.powers)
        assert (again.root, again.parts) == (value.root, value.parts)
    for kind, plain in ((int, True), (float, "1"), (list[int], 1), (tuple[int, int], [1])):
        with pytest.raises(ValueError, match="is no"):
            from_plain(kind, plain)
