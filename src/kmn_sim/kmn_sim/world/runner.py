"""Runs a simulation in a thread of its own, at a pace, with work to be done in between."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from concurrent.futures import Future, wait
from dataclasses import dataclass
from queue import SimpleQueue
from typing import Any, TypeVar

from kmn_sim.world.simulation import Simulation

ALIVE_PERIOD = 1.0  # seconds between two looks whether the simulation still runs
MAX_LAG = 0.1  # seconds; what is lost beyond is not made up for
Result = TypeVar("Result")


@dataclass
class Task:
    """Work that is due every ``period`` simulated seconds; ``due`` is when the next time."""

    period: float
    work: Callable[[Simulation], None]
    due: float


class Runner:
    """Owns a simulation; the physics engine and its renderer know one thread only.

    Parameters
    ----------
    make
        Makes the simulation, in the thread.
    fail
        Is told of an exception of a task, which then goes on all the same.

    Attributes
    ----------
    real_time_factor
        Simulated seconds in one second; 0 as fast as possible.
    achieved
        The same as it was of late.
    """

    def __init__(self, make: Callable[[], Simulation], fail: Callable[[Exception], None]) -> None:
        self.real_time_factor = 1.0
        self.achieved = 0.0
        self._make, self._fail = make, fail
        self._calls: SimpleQueue[tuple[Callable[[Simulation], Any], Future[Any]]] = SimpleQueue()
        self._tasks: list[Task] = []
        self._open = True
        self._started: Future[None] = Future()
        self._thread = threading.Thread(target=self._run, name="simulation", daemon=True)

    def start(self) -> None:
        """Start the thread; raise what making the simulation raises."""
        self._thread.start()
        self._started.result()

    def every(self, period: float, work: Callable[[Simulation], None]) -> Task:
        """Do some work every so many simulated seconds, beginning with the next step."""
        task = Task(period, work, 0.0)
        self._tasks.append(task)
        return task

    def call(self, function: Callable[[Simulation], Result]) -> Result:
        """Call a function with the simulation between two steps; return or raise what it does."""
        future: Future[Result] = Future()
        self._calls.put((function, future))
        while not future.done() and self._thread.is_alive():
            wait([future], timeout=ALIVE_PERIOD)
        if not future.done():
            raise RuntimeError("the simulation has ended")
        return future.result()

    def close(self) -> None:
        """End the thread."""
        self._open = False
        self._thread.join()

    def _run(self) -> None:
        try:
            simulation = self._make()
        except BaseException as error:
            self._started.set_exception(error)
            return
        self._started.set_result(None)
        start_wall, start_time = time.monotonic(), simulation.time
        factor = self.real_time_factor
        measured_wall, measured_time = start_wall, start_time
        while self._open:
            self._answer_calls(simulation)
            simulation.step()
            self._do_tasks(simulation)
            now = time.monotonic()
            if now - measured_wall >= 1.0:
                self.achieved = (simulation.time - measured_time) / (now - measured_wall)
                measured_wall, measured_time = now, simulation.time
            if self.real_time_factor != factor:
                factor, start_wall, start_time = self.real_time_factor, now, simulation.time
            if factor > 0.0:
                ahead = start_wall + (simulation.time - start_time) / factor - now
                if ahead > 0.0:
                    time.sleep(ahead)
                elif ahead < -MAX_LAG:
                    start_wall, start_time = now, simulation.time
        simulation.close()

    def _answer_calls(self, simulation: Simulation) -> None:
        while not self._calls.empty():
            function, future = self._calls.get()
            try:
                future.set_result(function(simulation))
            except Exception as error:
                future.set_exception(error)

    def _do_tasks(self, simulation: Simulation) -> None:
        for task in self._tasks:
            if simulation.time < task.due:
                continue
            task.due += task.period  # so that its rate is kept on average
            if task.due < simulation.time:
                task.due = simulation.time + task.period
            try:
                task.work(simulation)
            except Exception as error:
                self._fail(error)
