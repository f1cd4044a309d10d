"""What the tests of the package share."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing
from typing import Any

import numpy as np
import pytest

from kmn_perception.model.kinematic_model import KinematicModel
from kmn_sim.world.scenario import Scenario
from kmn_sim.world.settings import WorldSettings
from kmn_sim.world.simulation import Simulation

MakeSimulation = Callable[..., Simulation]


@pytest.fixture
def simulate() -> Iterator[MakeSimulation]:
    """Return a function that makes the simulation of a model, by default at its prototype."""
    with ExitStack() as stack:

        def make(model: str = "door", values: Any = None, **options: Any) -> Simulation:
            kinematic = KinematicModel.load(model)
            values = np.zeros(len(kinematic.parameters)) if values is None else np.array(values)
            renderer = options.pop("renderer", "egl")
            drift = options.pop("odometry_drift", 0.0)
            scenario = Scenario(kinematic, values, **options)
            simulation = Simulation(
                scenario,
                WorldSettings.load(),
                renderer=renderer,
                allow_partial=True,
                odometry_drift=drift,
            )
            return stack.enter_context(closing(simulation))

        yield make
