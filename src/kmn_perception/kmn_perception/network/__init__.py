"""Algorithm 1 (`morph`), the networks that it runs on, and their weight files.

The only room beside ``training`` that imports torch. Imports ``model`` and ``configuration``.
"""
