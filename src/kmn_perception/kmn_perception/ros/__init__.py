"""All that speaks ROS: morph_node, its messages and parameters, and what all nodes share.

``parameters``, ``program``, ``reports`` and ``node_process`` serve the nodes and programs of all
packages. Nothing that is imported here imports rclpy itself; on top of it stand ``bags`` and
``benchmark`` alone.
"""
