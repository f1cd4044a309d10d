"""An experiment as jobs of submitit's local executor."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cloudpickle
import pytest

from kmn_perception.sharing.experiment import ExperimentCommand, SharedExperiment
from kmn_perception.sharing.submit import submit


def parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="halves")
    parser.add_argument("--count", type=int, required=True)
    return parser


def half(number: int) -> float:
    return number / 2.0


def prepare(options: argparse.Namespace) -> SharedExperiment[float]:
    def conclude(found: list[float]) -> tuple[str, Any]:
        return f"{len(found)} halves", found

    return SharedExperiment("halves", "numbers", options.count, float, lambda: half, conclude)


LOCAL = ("--executor", "local")
FIVE = ("halves", "--count", "5")
HALVES = ExperimentCommand("kmn_test", "halves", parser, prepare, ())


@pytest.fixture(autouse=True)
def experiment_of_this_file() -> Iterator[None]:
    """Send what this file holds to the jobs, which cannot import it."""
    cloudpickle.register_pickle_by_value(sys.modules[__name__])
    yield
    cloudpickle.unregister_pickle_by_value(sys.modules[__name__])


def test_jobs_give_what_one_run_gives_and_go_on_where_it_was(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    first, joined = tmp_path / "0.jsonl", tmp_path / "joined.json"
    HALVES.start(["--count", "5", "--shard", "0/2", "--records", str(first)])
    done = first.read_bytes()
    capsys.readouterr()
    words = [*LOCAL, "--folder", str(tmp_path), *FIVE, "--json", str(joined)]
    submit([HALVES], ["--shards", "2", *words])
    assert capsys.readouterr().out == "5 halves\n"
    assert json.loads(joined.read_text()) == [0.0, 0.5, 1.0, 1.5, 2.0]
    assert first.read_bytes() == done


def test_a_job_that_fails_says_why(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "0.jsonl").write_text("weights\n")
    with pytest.raises(SystemExit, match="1"):
        submit([HALVES], ["--shards", "1", *LOCAL, "--folder", str(tmp_path), *FIVE])
    assert f"shard 0/1: {tmp_path}/0.jsonl is no file of records" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ((*FIVE, "--shard", "0/2", "--records", "x"), "are given to each job"),
        ((*FIVE, "--sampels"), "unrecognized arguments: --sampels"),
        (("--parameter", "cpus", "halves"), "cpus is not NAME=VALUE"),
    ],
)
def test_what_cannot_run_is_not_submitted(
    words: tuple[str, ...],
    message: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit, match="2"):
        submit([HALVES], ["--shards", "2", *LOCAL, "--folder", "run", *words])
    assert message in capsys.readouterr().err
    assert not (tmp_path / "run").exists()


def test_an_unknown_parameter_is_named(tmp_path: Path) -> None:
    given = ["--shards", "2", *LOCAL, "--folder", str(tmp_path)]
    with pytest.raises(SystemExit, match="submit: .*partitoin"):
        submit([HALVES], [*given, "--parameter", "slurm_partitoin=x", *FIVE])
