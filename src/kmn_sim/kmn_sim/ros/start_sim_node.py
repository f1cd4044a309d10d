"""The executable ``sim_node``."""

from __future__ import annotations

import sys

from kmn_perception.ros.program import run_node
from kmn_sim.ros.sim_node import SimNode


def main() -> int:
    """Run the executable ``sim_node``; being interrupted is its normal end."""
    return run_node("sim_node", SimNode)


if __name__ == "__main__":
    sys.exit(main())
