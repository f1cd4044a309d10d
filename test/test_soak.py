"""A minute under load ends well: goals have their results, and no node falls by itself."""

from __future__ import annotations

import subprocess
import sys

import pytest


@pytest.mark.timeout(900)
def test_a_minute_of_soak_ends_with_its_tables() -> None:
    pytest.importorskip("robotic")
    command = [sys.executable, "-m", "kmn_skill", "soak", "--hours", "0.02"]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "frames lost" in done.stdout
    assert all(f"\n{node} " in done.stdout for node in ("sim_node", "morph_node", "skill_node"))
