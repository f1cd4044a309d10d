"""From an object's parameters to a plan: policy, solver, time parametrisation, and their check.

`planner` is the front door; it plans in a process of its own. Imports nothing else of this package;
without ROS.
"""
