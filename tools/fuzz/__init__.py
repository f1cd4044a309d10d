"""Hostile files and messages for everything that the project reads: ``make fuzz``."""
