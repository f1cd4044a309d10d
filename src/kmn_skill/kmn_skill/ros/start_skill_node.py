"""The executable ``skill_node``."""

from __future__ import annotations

import sys

from kmn_perception.ros.program import run_node
from kmn_skill.ros.skill_node import SkillNode


def main() -> int:
    """Run the executable ``skill_node``; interrupted, it lets the robot hold and ends."""
    return run_node("skill_node", SkillNode, has_last_words=True)


if __name__ == "__main__":
    sys.exit(main())
