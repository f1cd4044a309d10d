"""What sees the world: renderer, depth camera with its noise, and recordings of a run.

Imports ``world``; without ROS.
"""
