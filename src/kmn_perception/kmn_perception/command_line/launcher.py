"""Executables that load their modules when they start.

Torch and ROS take seconds to load, in which Ctrl-C shall be as quiet as later on.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from importlib import import_module

INTERRUPTED = 130  # exit status of a program that Ctrl-C ended, by convention 128 + SIGINT


def executable(module: str, simulator: str | None = None) -> Callable[[], int | None]:
    """Return a function that runs the ``main`` of a module.

    Parameters
    ----------
    module
        Its full name.
    simulator
        A Python package that it may need, and that not everyone has installed.
    """

    def start() -> int | None:
        try:
            status: int | None = import_module(module).main()
        except ModuleNotFoundError as error:
            if simulator is None or error.name != simulator:
                raise
            print(
                f"{simulator} is missing; install it with: make setup-simulation", file=sys.stderr
            )
            return 1
        except KeyboardInterrupt:
            return INTERRUPTED
        return status

    return start
