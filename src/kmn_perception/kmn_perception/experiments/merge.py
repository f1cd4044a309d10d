"""Join the shards of an experiment on perception."""

from __future__ import annotations

from collections.abc import Sequence

from kmn_perception.evaluation import evaluate, evaluate_models
from kmn_perception.experiments import evaluate_doors
from kmn_perception.sharing.merge import merge

COMMANDS = (evaluate.COMMAND, evaluate_models.COMMAND, evaluate_doors.COMMAND)


def main(argv: Sequence[str] | None = None) -> None:
    """Run the executable ``merge``."""
    merge(COMMANDS, argv)
