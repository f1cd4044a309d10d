"""From a frame to what may be objects: the support plane, segmentation, free space, tracking.

Also the diagnosis of a sensor whose description is likely to be wrong. Imports ``model`` and
``configuration``; knows neither network nor refinement.
"""
