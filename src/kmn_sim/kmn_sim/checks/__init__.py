"""Programs that show or measure the simulator and, live through its topics, the perception.

May import all other rooms; nothing imports it.
"""
