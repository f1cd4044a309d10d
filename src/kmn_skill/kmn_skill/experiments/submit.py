"""Run an experiment on skills as jobs of a cluster, or as processes of this machine."""

from __future__ import annotations

from collections.abc import Sequence

from kmn_perception.sharing.submit import submit
from kmn_skill.experiments.merge import COMMANDS


def main(words: Sequence[str] | None = None) -> None:
    """Run the executable ``submit``."""
    submit(COMMANDS, words)
