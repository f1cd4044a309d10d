"""Hostile files and messages make no faults, and what would be one is found."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]


def fuzz(folder: Path, *options: str) -> subprocess.CompletedProcess[str]:
    paths = os.pathsep.join([str(ROOT / "tools"), os.environ.get("PYTHONPATH", "")])
    return subprocess.run(
        [sys.executable, "-m", "fuzz", "--out", str(folder), *options],
        env={**os.environ, "PYTHONPATH": paths, "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"},
        capture_output=True,
        text=True,
    )


def test_every_kind_of_file_is_read_or_refused(tmp_path: Path) -> None:
    done = fuzz(tmp_path, "--what", "files", "--cases", "260", "--seed", "7")
    assert done.returncode == 0, done.stdout + done.stderr
    *_, last = done.stdout.splitlines()
    name, cases, refused, accepted, *_, faults = last.split()
    assert (name, cases, faults) == ("all", "260", "0")
    assert int(refused) > 40
    assert int(accepted) > 40
    assert list(tmp_path.iterdir()) == []


@pytest.mark.timeout(900)
def test_no_node_falls_of_hostile_messages(tmp_path: Path) -> None:
    done = fuzz(tmp_path, "--what", "messages", "--cases", "100", "--seed", "7")
    assert done.returncode == 0, done.stdout + done.stderr
