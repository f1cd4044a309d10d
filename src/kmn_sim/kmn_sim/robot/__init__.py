"""The robot: its model as a URDF, its settings, and its motors in the physics.

Imports ``control`` only.
"""
