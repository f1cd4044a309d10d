"""The simulation's thread: its pace, calls into it, and what goes wrong in it."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from kmn_perception.model.kinematic_model import KinematicModel
from kmn_sim.world.runner import Runner
from kmn_sim.world.scenario import Scenario
from kmn_sim.world.settings import WorldSettings
from kmn_sim.world.simulation import Simulation


def make() -> Simulation:
    model = KinematicModel.load("door")
    return Simulation(Scenario(model, np.zeros(7)), WorldSettings.load(), renderer="software")


@pytest.fixture
def failures() -> list[Exception]:
    return []


@pytest.fixture
def runner(failures: list[Exception]) -> Iterator[Runner]:
    made = Runner(make, failures.append)
    made.real_time_factor = 0.0
    made.start()
    yield made
    made.close()


def advance(runner: Runner, seconds: float) -> float:
    """Wait until so much simulated time has passed; return the time."""
    end = runner.call(lambda simulation: simulation.time) + seconds
    while (now := runner.call(lambda simulation: simulation.time)) < end:
        pass
    return now


def test_tasks_come_at_their_rate(runner: Runner) -> None:
    times: list[float] = []
    runner.every(0.02, lambda simulation: times.append(simulation.time))
    advance(runner, 1.0)
    steps = np.diff(times[1:])
    assert steps.mean() == pytest.approx(0.02, rel=0.03)
    assert steps.max() < 0.03


def test_calls_return_and_raise_what_the_function_does(runner: Runner) -> None:
    assert runner.call(lambda simulation: simulation.scenario.model.name) == "door"
    with pytest.raises(ZeroDivisionError):
        runner.call(lambda _: 1 / 0)
    advance(runner, 0.1)


def test_a_failing_task_is_told_and_the_physics_goes_on(
    runner: Runner, failures: list[Exception]
) -> None:
    def fail(_: Simulation) -> None:
        raise ValueError("broken")

    runner.every(0.1, fail)
    advance(runner, 0.5)
    assert str(failures[0]) == "broken"


def test_what_hinders_the_start_is_raised() -> None:
    def refuse() -> Simulation:
        raise OSError("no model")

    with pytest.raises(OSError, match="no model"):
        Runner(refuse, lambda _: None).start()


def test_after_the_end_a_call_says_so(failures: list[Exception]) -> None:
    runner = Runner(make, failures.append)
    runner.start()
    runner.close()
    with pytest.raises(RuntimeError, match="the simulation has ended"):
        runner.call(lambda simulation: simulation.time)
