"""Algorithm 1 (`morph`), the designs of networks that it runs on, and their weight files.

Another design is a class in a file here and a line in ``designs``.

The only room beside ``training`` that imports torch. Imports ``model`` and ``configuration``.
"""
