"""Starts an executable of the package: ``python -m kmn_sim NAME ARGUMENTS``."""

from __future__ import annotations

import sys

from kmn_perception.command_line.launcher import launch
from kmn_sim.executables import EXECUTABLES


def main() -> int:
    """Start the executable that the command line names."""
    return launch("kmn_sim", EXECUTABLES)


if __name__ == "__main__":
    sys.exit(main())
