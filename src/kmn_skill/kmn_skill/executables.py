"""The executables of the package; each loads its module when it starts."""

from __future__ import annotations

import sys
from collections.abc import Callable
from importlib import import_module

INTERRUPTED = 130  # exit status of a program that Ctrl-C ended, by convention 128 + SIGINT
PLANNER = "robotic"
HINT = "install it with: make setup-simulation"


def _executable(module: str) -> Callable[[], int | None]:
    def start() -> int | None:
        try:
            status: int | None = import_module(f"kmn_skill.{module}").main()
        except ModuleNotFoundError as error:
            if error.name != PLANNER:
                raise
            print(f"{error.name} is missing; {HINT}", file=sys.stderr)
            return 1
        except KeyboardInterrupt:
            return INTERRUPTED
        return status

    return start


skill_node = _executable("start_skill_node")
evaluate = _executable("evaluate")
demo = _executable("demo")
