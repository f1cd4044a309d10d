"""Run an experiment on perception as jobs of a cluster, or as processes of this machine."""

from __future__ import annotations

from collections.abc import Sequence

from kmn_perception.experiments.merge import COMMANDS
from kmn_perception.sharing.submit import submit


def main(words: Sequence[str] | None = None) -> None:
    """Run the executable ``submit``."""
    submit(COMMANDS, words)
