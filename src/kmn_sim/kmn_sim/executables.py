"""The executables of the package."""

from __future__ import annotations

from kmn_perception.executable import executable as _executable

SIMULATOR = "pybullet"

sim_node = _executable("kmn_sim.start_sim_node", SIMULATOR)
snapshot = _executable("kmn_sim.snapshot", SIMULATOR)
check_perception = _executable("kmn_sim.check_perception", SIMULATOR)
check_noise = _executable("kmn_sim.check_noise", SIMULATOR)
benchmark = _executable("kmn_sim.benchmark", SIMULATOR)
robot_description = _executable("kmn_sim.robot_description", SIMULATOR)
