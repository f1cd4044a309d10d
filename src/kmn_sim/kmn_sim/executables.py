"""The executables of the package: the one list that set-up, ``run`` and launcher read."""

# Name, module with a ``main``, and what it needs beside the nodes: each USE of ``make setup-USE``.
EXECUTABLES = {
    "sim_node": ("kmn_sim.ros.sim_node", "simulation"),
    "snapshot": ("kmn_sim.checks.snapshot", "simulation"),
    "check_perception": ("kmn_sim.checks.check_perception", "simulation"),
    "check_noise": ("kmn_sim.checks.check_noise", "simulation"),
    "benchmark": ("kmn_sim.checks.benchmark", "simulation"),
    "robot_description": ("kmn_sim.robot.robot_description", "simulation"),
}
