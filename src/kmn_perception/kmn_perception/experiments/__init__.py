"""The experiments on labelled frames, of boxes and of doors: the estimates and their errors.

Imports the pipeline, ``doors``, ``evaluation``, ``visualization``, and the node's parameters of
``ros``.
"""
