"""Starts an executable: what ends it before its own code is loaded is said in one line.

Torch and ROS take seconds to load, in which Ctrl-C shall be as quiet as later on.
"""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Mapping
from importlib import import_module
from pathlib import Path
from types import FrameType

MIDDLEWARE = "RMW_IMPLEMENTATION"  # the variable that chooses it
BLAS_THREADS = "OPENBLAS_NUM_THREADS"  # read when numpy is loaded
OWN = "kmn_"  # our packages begin with it
INTERRUPTED = 128 + signal.SIGINT  # exit status, by convention


def launch(package: str, executables: Mapping[str, tuple[str, str]]) -> int:
    """Run the executable that the command line names, and return its exit status.

    Parameters
    ----------
    package
        Whose executables they are; in ``python -m PACKAGE NAME`` the name is the first argument,
        otherwise it is that of the script.
    executables
        Of each name the module, and what it needs: see ``executables.py``.
    """
    if Path(sys.argv[0]).name == "__main__.py":
        del sys.argv[0]
    name = Path(sys.argv[0]).name if sys.argv else ""
    if name not in executables:
        known = ", ".join(executables)
        print(f"{package}: '{name}' is no executable; there are: {known}", file=sys.stderr)
        return 2
    module, needs = executables[name]
    if problem := middleware_problem():
        print(f"{name}: {problem}", file=sys.stderr)
        return 1
    # Matrices are small here: a second thread of BLAS only waits for the first, and burns a core.
    os.environ.setdefault(BLAS_THREADS, "1")
    signal.signal(signal.SIGINT, _quit)  # an exception could get lost in what is being loaded
    try:
        main = import_module(module).main
        signal.signal(signal.SIGINT, signal.default_int_handler)
        return main() or 0
    except ModuleNotFoundError as error:
        if error.name is None or (error.name.startswith(OWN) and error.name != "kmn_msgs"):
            raise
        target = " ".join(f"setup-{use}" for use in needs.split()) or "build"
        print(f"{name}: {error.name} is missing; install it with: make {target}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        return INTERRUPTED


def middleware_problem() -> str:
    """Return why ROS would end the process when it is loaded, or nothing."""
    middleware = os.environ.get(MIDDLEWARE, "")
    prefixes = [Path(folder) for folder in os.environ.get("AMENT_PREFIX_PATH", "").split(":")]
    index = "share/ament_index/resource_index/packages"
    if not middleware or any((prefix / index / middleware).is_file() for prefix in prefixes):
        return ""
    return (
        f"{MIDDLEWARE} is '{middleware}', which is not installed here; unset it: unset {MIDDLEWARE}"
    )


def _quit(number: int, frame: FrameType | None) -> None:
    """End at once; nothing has begun that would have to be ended."""
    os._exit(128 + number)
