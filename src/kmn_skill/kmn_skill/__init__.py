"""Manipulation skills planned on the estimated kinematic model."""
