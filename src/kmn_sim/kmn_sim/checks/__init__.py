"""Programs that measure the simulator and, live through its topics, the perception.

Imports all other rooms; nothing imports it.
"""
