"""The experiment on real frames: references from labels, the estimates, and their errors.

Imports the pipeline and ``visualization``; not ``ros``.
"""
