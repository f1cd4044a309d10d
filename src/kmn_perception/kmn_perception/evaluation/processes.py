"""Samples measured by several processes, one thread each."""

from __future__ import annotations

import math
import multiprocessing
import signal
from collections.abc import Iterator

from kmn_perception.evaluation.comparison import Comparison, Measurement, Request
from kmn_perception.evaluation.settings import EvaluationSettings
from kmn_perception.network.threads import use_one_thread

MIN_SAMPLES = 50  # of a process; for fewer its start, some seconds, does not pay

Measured = tuple[float, dict[str, Measurement]]

_comparison: Comparison  # of a started process


def measurements(
    comparison: Comparison, request: Request, settings: EvaluationSettings, samples: int, jobs: int
) -> Iterator[Measured]:
    """Yield what ``comparison`` measures on samples 0, 1, 2, ..., in this order."""
    count = min(jobs, math.ceil(samples / MIN_SAMPLES))
    if count == 1:
        use_one_thread()
        yield from map(comparison, range(samples))
        return
    context = multiprocessing.get_context("spawn")
    with context.Pool(count, _start, (request, settings)) as pool:
        yield from pool.imap(_measure, range(samples))


def _start(request: Request, settings: EvaluationSettings) -> None:
    global _comparison
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the first process ends the others
    use_one_thread()
    _comparison = Comparison(request, settings)


def _measure(index: int) -> Measured:
    return _comparison(index)
