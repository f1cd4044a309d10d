"""sim_node: the simulated world behind topics, services and parameters.

May import all other rooms but ``checks``, which stands on top of it.
"""
