"""Pictures of estimated models over the depth images that they were estimated from.

Imports ``model`` and ``configuration``.
"""
