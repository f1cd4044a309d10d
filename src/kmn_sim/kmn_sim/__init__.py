"""Simulated world of a robot, an articulated object and a depth camera."""
