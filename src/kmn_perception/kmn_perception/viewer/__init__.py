"""The live view in a browser: what is perceived, planned and done, and buttons for it.

Imports ``ros``, ``visualization``, ``scene`` and ``model``; the only room that imports viser.
It looks on: it runs in a process of its own, and draws at a rate of its own.
"""
