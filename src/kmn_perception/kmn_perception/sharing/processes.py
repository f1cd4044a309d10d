"""Work on many items, shared by several processes of one thread each."""

from __future__ import annotations

import math
import multiprocessing
import os
import signal
import threading
from collections import deque
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import AbstractContextManager, ExitStack
from multiprocessing.util import Finalize
from typing import Any, TypeVar

from kmn_perception.network.threads import use_one_thread

Item = TypeVar("Item")
Result = TypeVar("Result")

AHEAD = 4  # items of each process that wait for it

_work: Callable[[Any], Any]  # of a started process


def in_order(
    make: Callable[[], Callable[[Item], Result]],
    items: Sequence[Item],
    jobs: int,
    worthwhile: int = 1,
) -> Generator[Result, None, None]:
    """Yield the result for each item, in the order of the items.

    Parameters
    ----------
    make
        Makes the function that is applied, once in each process; can be pickled. Where that is a
        context, the context is entered, and left at the end of the process's work.
    jobs
        How many processes, at most; one is this process.
    worthwhile
        Items of a process; for fewer its start, some seconds, does not pay.

    Raises
    ------
    ChildProcessError
        If one of the processes is killed, as where memory is short.
    """
    count = min(jobs, math.ceil(len(items) / worthwhile))
    if count > 1:
        yield from _by_processes(make, items, count)
    elif count == 1:
        with ExitStack() as stack:
            yield from map(_entered(make, stack), items)


def _by_processes(
    make: Callable[[], Callable[[Item], Result]], items: Sequence[Item], count: int
) -> Generator[Result, None, None]:
    context = multiprocessing.get_context("spawn")
    pool = ProcessPoolExecutor(count, context, _start, (make,))
    waiting: deque[Future[Result]] = deque()
    try:
        for item in items:
            waiting.append(pool.submit(_run, item))
            if len(waiting) >= AHEAD * count:
                yield waiting.popleft().result()
        while waiting:
            yield waiting.popleft().result()
    except BrokenProcessPool as error:
        raise ChildProcessError(
            f"one of {count} processes was killed; if memory is short, use fewer --jobs"
        ) from error
    finally:
        pool.shutdown(cancel_futures=True)


def _entered(make: Callable[[], Callable[[Item], Result]], stack: ExitStack) -> Any:
    work = make()
    return stack.enter_context(work) if isinstance(work, AbstractContextManager) else work


def _start(make: Callable[[], Callable[[Any], Any]]) -> None:
    global _work
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the first process ends the others
    threading.Thread(target=_end_with_the_first, daemon=True).start()
    use_one_thread()
    stack = ExitStack()
    Finalize(None, stack.close, exitpriority=0)
    _work = _entered(make, stack)


def _end_with_the_first() -> None:
    """End this process when the first was killed, which then could not end it."""
    first = multiprocessing.parent_process()
    if first is not None:
        first.join()
        os.kill(os.getpid(), signal.SIGTERM)


def _run(item: Any) -> Any:
    return _work(item)
