"""What stands in the world and how it moves: scenario, object, physics engine, and time.

Imports ``robot``, ``control`` and, for pictures of the world, ``sensors.renderer``.
"""
