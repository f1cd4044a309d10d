"""Join the shards of an experiment on skills."""

from __future__ import annotations

from collections.abc import Sequence

from kmn_perception.sharing.merge import merge
from kmn_skill.experiments import evaluate, plan_doors

COMMANDS = (evaluate.COMMAND, plan_doors.COMMAND)


def main(words: Sequence[str] | None = None) -> None:
    """Run the executable ``merge``."""
    merge(COMMANDS, words)
