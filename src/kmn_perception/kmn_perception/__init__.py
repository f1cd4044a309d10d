"""Kinematic Morphing Networks: from a depth camera to the morphing parameters of an object."""
