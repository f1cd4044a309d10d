"""Starts an executable of the package: ``python -m kmn_perception NAME ARGUMENTS``."""

from __future__ import annotations

import sys

from kmn_perception.command_line.launcher import launch
from kmn_perception.executables import EXECUTABLES


def main() -> int:
    """Start the executable that the command line names."""
    return launch("kmn_perception", EXECUTABLES)


if __name__ == "__main__":
    sys.exit(main())
