"""Samples measured by several processes, one thread each."""

from __future__ import annotations

import math
import multiprocessing
import signal
from collections.abc import Callable, Iterator
from typing import Any, TypeVar

from kmn_perception.network.threads import use_one_thread

MIN_SAMPLES = 50  # of a process; for fewer its start, some seconds, does not pay

Measured = TypeVar("Measured")
Measure = Callable[[int], Measured]

_measure: Measure[Any]  # of a started process


def measurements(
    measure: Measure[Measured], make: Callable[[], Measure[Measured]], samples: int, jobs: int
) -> Iterator[Measured]:
    """Yield what is measured on samples 0, 1, 2, ..., in this order.

    Parameters
    ----------
    measure, make
        What measures a sample, and what makes its like in each of the processes.
    """
    count = min(jobs, math.ceil(samples / MIN_SAMPLES))
    if count == 1:
        use_one_thread()
        yield from map(measure, range(samples))
        return
    context = multiprocessing.get_context("spawn")
    with context.Pool(count, _start, (make,)) as pool:
        yield from pool.imap(_run, range(samples))


def _start(make: Callable[[], Measure[Any]]) -> None:
    global _measure
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the first process ends the others
    use_one_thread()
    _measure = make()


def _run(index: int) -> Any:
    return _measure(index)
