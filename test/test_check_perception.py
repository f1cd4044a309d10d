"""The check of morph_node on simulated scenes, as it is run."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

pytest.importorskip("pybullet")


@pytest.mark.parametrize("model", [pytest.param("box_a", marks=pytest.mark.slow), "door"])
def test_simulated_scenes_are_seen_as_they_stand(model: str, domain: int) -> None:
    """Boxes creep, by micrometres in a second: their scene is answered all the same."""
    command = [sys.executable, "-m", "kmn_sim", "check_perception"]
    done = subprocess.run(
        [*command, "--model", model, "--scenes", "4", "--seed", "7"],
        env={**os.environ, "ROS_DOMAIN_ID": str(domain)},
        capture_output=True,
        text=True,
        timeout=180,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[-1].startswith("4 of 4 scenes are OK")
