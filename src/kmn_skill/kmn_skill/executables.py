"""The executables of the package."""

from __future__ import annotations

from kmn_perception.executable import executable as _executable

PLANNER = "robotic"

skill_node = _executable("kmn_skill.start_skill_node", PLANNER)
evaluate = _executable("kmn_skill.evaluate", PLANNER)
demo = _executable("kmn_skill.demo", PLANNER)
