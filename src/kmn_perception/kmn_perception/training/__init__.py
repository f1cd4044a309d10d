"""The offline training tools: Algorithm 2 of the paper, training by stages, and training on walls.

Imports ``doors``, ``rooms``, ``network``, ``scene``, ``model``, ``configuration`` and
``command_line``.
"""
