"""The executables of the package."""

from __future__ import annotations

from kmn_perception.command_line.launcher import executable as _executable

SIMULATOR = "pybullet"

sim_node = _executable("kmn_sim.ros.start_sim_node", SIMULATOR)
snapshot = _executable("kmn_sim.checks.snapshot", SIMULATOR)
check_perception = _executable("kmn_sim.checks.check_perception", SIMULATOR)
check_noise = _executable("kmn_sim.checks.check_noise", SIMULATOR)
benchmark = _executable("kmn_sim.checks.benchmark", SIMULATOR)
robot_description = _executable("kmn_sim.robot.robot_description", SIMULATOR)
