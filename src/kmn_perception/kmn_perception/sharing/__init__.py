"""Work on many items: shared by processes and machines, resumed where it stopped, joined again.

Imports ``configuration``, ``command_line`` and ``network``; training and all experiments use it.
"""
