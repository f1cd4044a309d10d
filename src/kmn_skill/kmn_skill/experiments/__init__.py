"""Programs: the demo, random doors in the simulator, plans without one, and the prototypes.

May import all other rooms; nothing imports it.
"""
