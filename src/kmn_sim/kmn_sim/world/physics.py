"""A physics engine of its own: pybullet's functions, bound to one of its worlds."""

from __future__ import annotations

import inspect
from functools import partial

import pybullet


class Physics:
    """Has all that the module ``pybullet`` has; the functions act on this world.

    As pybullet's own BulletClient, but it binds the functions once: they are called thousands of
    times a second.

    Parameters
    ----------
    gui
        Whether a window shows the world.
    """

    def __init__(self, gui: bool) -> None:
        client = pybullet.connect(pybullet.GUI if gui else pybullet.DIRECT)
        for name, value in vars(pybullet).items():
            if inspect.isbuiltin(value):
                value = partial(value, physicsClientId=client)
            setattr(self, name, value)
