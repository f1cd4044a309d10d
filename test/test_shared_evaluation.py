"""Shards of opened doors are joined to what one run gives."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("pybullet")

OPTIONS = ("--doors", "2", "--mode", "push", "--parameters", "true", "--seed", "3")


def run(domain: int, executable: str, *words: str | Path) -> str:
    """Return what an executable of kmn_skill prints."""
    command = [sys.executable, "-m", "kmn_skill", executable, *map(str, words)]
    environment = {**os.environ, "ROS_DOMAIN_ID": str(domain)}
    return subprocess.run(command, check=True, text=True, stdout=-1, env=environment).stdout


@pytest.mark.slow
def test_shards_of_opened_doors_are_joined_to_what_one_run_gives(
    domain: int, tmp_path: Path
) -> None:
    one, two = tmp_path / "one.json", tmp_path / "two.json"
    run(domain, "evaluate", *OPTIONS, "--json", one)
    files = [tmp_path / f"{shard}.jsonl" for shard in range(2)]
    for shard, file in enumerate(files):
        run(domain, "evaluate", *OPTIONS, "--shard", f"{shard}/2", "--records", file)
    run(domain, "merge", *files, "--json", two)
    whole, joined = (json.loads(file.read_text()) for file in (one, two))
    counts = ("doors", "planned", "executed", "opened", "false_success")
    assert [joined[name] for name in counts] == [whole[name] for name in counts]
    assert whole["opened"] == 2
    # Physics run beside planning: what is measured is nearly the same.
    assert joined["hinge_error_rad"]["max"] == pytest.approx(
        whole["hinge_error_rad"]["max"], abs=0.01
    )
