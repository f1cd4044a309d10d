"""The executable ``morph_node``."""

from __future__ import annotations

import sys

from kmn_perception.ros.morph_node import MorphNode
from kmn_perception.ros.program import run_node


def main() -> int:
    """Run the executable ``morph_node``; being interrupted is its normal end."""
    return run_node("morph_node", MorphNode)


if __name__ == "__main__":
    sys.exit(main())
