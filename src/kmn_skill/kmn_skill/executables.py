"""The executables of the package."""

from __future__ import annotations

from kmn_perception.command_line.launcher import executable as _executable

PLANNER = "robotic"

skill_node = _executable("kmn_skill.ros.start_skill_node", PLANNER)
evaluate = _executable("kmn_skill.experiments.evaluate", PLANNER)
demo = _executable("kmn_skill.experiments.demo", PLANNER)
