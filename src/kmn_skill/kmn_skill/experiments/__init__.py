"""Programs: the demo, random doors in the simulator, plans without one, and the prototypes.

Imports all other rooms; nothing imports it.
"""
