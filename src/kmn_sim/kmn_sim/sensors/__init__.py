"""What sees the world: depth camera with its noise, and recordings of a run.

Imports ``world`` and what that imports; without ROS.
"""
