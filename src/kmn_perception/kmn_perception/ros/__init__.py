"""All that speaks ROS: morph_node, its messages and parameters, and what all nodes share.

``parameters``, ``program``, ``reports`` and ``node_process`` serve the nodes and programs of all
packages, as does ``node_program``. On top of the room stand ``experiments``, ``bags`` and
``benchmark``.
"""
