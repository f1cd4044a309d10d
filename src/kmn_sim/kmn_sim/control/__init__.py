"""Joint trajectories: what a command must fulfil, its interpolation, and which one is followed.

The semantics are those of ros2_control. Imports nothing of this package.
"""
