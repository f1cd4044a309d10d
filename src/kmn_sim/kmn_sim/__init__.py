"""Simulated world of a robot, an articulated object and a depth camera.

The rooms: ``control`` (trajectories), ``robot``, ``world`` (object, physics, time), ``sensors``
(cameras), ``ros`` (the node), and on top of it ``checks``. Each imports only from those before it.
"""
