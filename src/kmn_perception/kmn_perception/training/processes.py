"""Work on many samples, shared by several processes of one thread each."""

from __future__ import annotations

import math
import multiprocessing
import signal
from collections.abc import Callable, Generator, Sequence
from typing import Any, TypeVar

from kmn_perception.network.threads import use_one_thread

Item = TypeVar("Item")
Result = TypeVar("Result")

_work: Callable[[Any], Any]  # of a started process


def in_order(
    make: Callable[[], Callable[[Item], Result]],
    items: Sequence[Item],
    processes: int,
    worthwhile: int = 1,
) -> Generator[Result, None, None]:
    """Yield the result for each item, in the order of the items.

    Parameters
    ----------
    make
        Makes the function that is applied, once in each process; can be pickled.
    processes
        How many, at most; one works in this process.
    worthwhile
        Items of a process; for fewer its start, some seconds, does not pay.
    """
    count = min(processes, math.ceil(len(items) / worthwhile))
    if count <= 1:
        yield from map(make(), items)
        return
    context = multiprocessing.get_context("spawn")
    with context.Pool(count, _start, (make,)) as pool:
        yield from pool.imap(_run, items)


def _start(make: Callable[[], Callable[[Any], Any]]) -> None:
    global _work
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the first process ends the others
    use_one_thread()
    _work = make()


def _run(item: Any) -> Any:
    return _work(item)
