"""The experiment on real frames: references from labels, the estimates, and their errors.

Imports the pipeline, ``evaluation``, ``visualization``, and of ``ros`` the node's parameters.
"""
