"""The offline training tool: Algorithm 2 of the paper, and the training of our network by stages.

Imports ``network``, ``scene``, ``model``, ``configuration`` and ``command_line``.
"""
