"""The executables of the package: the one list that set-up, ``run`` and launcher read."""

# Name, module with a ``main``, and what it needs beside the nodes: each USE of ``make setup-USE``.
EXECUTABLES = {
    "skill_node": ("kmn_skill.ros.skill_node", "simulation"),
    "open_door": ("kmn_skill.experiments.open_door", "simulation"),
    "check_robot": ("kmn_skill.experiments.check_robot", "simulation"),
    "evaluate": ("kmn_skill.experiments.evaluate", "simulation"),
    "kill_nodes": ("kmn_skill.experiments.kill_nodes", "simulation"),
    "demo": ("kmn_skill.experiments.demo", "simulation"),
    "soak": ("kmn_skill.experiments.soak.soak", "simulation"),
    "merge": ("kmn_skill.experiments.merge", "simulation"),
    "submit": ("kmn_skill.experiments.submit", "simulation cluster"),
    "plan_doors": ("kmn_skill.experiments.plan_doors", "simulation"),
    "make_prototypes": ("kmn_skill.experiments.make_prototypes", "simulation"),
}
