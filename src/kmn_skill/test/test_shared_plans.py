"""Shards of plans for random doors are joined to what one run gives."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from kmn_skill.experiments import plan_doors
from kmn_skill.experiments.merge import main as merge_main

OPTIONS = ("--doors", "3", "--mode", "pull", "--seed", "5")


def steady(file: Path) -> Any:
    """Return a result without the times, which vary from run to run."""
    result = json.loads(file.read_text())
    assert result.pop("planning_s")["median"] > 0.0
    return result


def test_shards_of_plans_are_joined_to_what_one_run_gives(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    one, two = tmp_path / "one.json", tmp_path / "two.json"
    plan_doors.COMMAND.start([*OPTIONS, "--json", str(one)])
    files = [str(tmp_path / f"{shard}.jsonl") for shard in range(2)]
    for shard, file in enumerate(files):
        plan_doors.COMMAND.start([*OPTIONS, "--shard", f"{shard}/2", "--records", file])
    capsys.readouterr()
    merge_main([*files, "--json", str(two)])
    assert capsys.readouterr().out.startswith("planned ")
    assert steady(two) == steady(one)
    assert json.loads(two.read_text())["planned"] == 3
