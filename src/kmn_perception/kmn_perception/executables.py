"""The executables of the package; each loads its module when it starts.

Torch and ROS take seconds to load, in which Ctrl-C shall be as quiet as later on.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module

INTERRUPTED = 130  # exit status of a program that Ctrl-C ended, by convention 128 + SIGINT


def _executable(module: str) -> Callable[[], int | None]:
    def start() -> int | None:
        try:
            status: int | None = import_module(f"kmn_perception.{module}").main()
        except KeyboardInterrupt:
            return INTERRUPTED
        return status

    return start


morph_node = _executable("start_morph_node")
replay = _executable("replay")
make_example_bag = _executable("example_bag")
demo_bag = _executable("demo")
train = _executable("training.train")
evaluate = _executable("evaluation.evaluate")
evaluate_frames = _executable("frames.evaluate_frames")
results = _executable("evaluation.results")
benchmark = _executable("benchmark")
