"""What stands in the world and how it moves: scenario, object, physics engine, renderer, and time.

Imports ``robot`` and ``control``.
"""
