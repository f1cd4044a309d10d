"""skill_node: the action, its messages and parameters.

Imports ``execution`` and ``planning``; ``experiments`` stands on top of it.
"""
