"""The mechanics of the door: hinge, stop, handle spring and latch."""

from __future__ import annotations

import itertools
from collections.abc import Callable

import numpy as np
import pytest

from kmn_perception.model.rendering import render
from kmn_sim.world.door import HANDLE_LINK, PANEL_LINK
from kmn_sim.world.simulation import Simulation

DIRECTIONS = {"pull": -1.0, "push": 1.0}
TURNED = -0.7
Simulate = Callable[..., Simulation]


def force(simulation: Simulation, newton: float, seconds: float, hold: float | None = None) -> None:
    """Push at the handle along x; ``hold`` keeps the handle at an angle."""
    physics, door = simulation.physics, simulation.door
    assert door is not None
    for _ in range(round(seconds / simulation.step_time)):
        if hold is not None:
            physics.resetJointState(door.body, HANDLE_LINK, hold)
        at = physics.getLinkState(door.body, HANDLE_LINK)[0]
        physics.applyExternalForce(
            door.body, HANDLE_LINK, (newton, 0.0, 0.0), at, physics.WORLD_FRAME
        )
        simulation.step()


def hinge(simulation: Simulation) -> float:
    assert simulation.door is not None
    return simulation.door.state().hinge


@pytest.mark.parametrize("direction", DIRECTIONS)
def test_latch_holds_50_newton_until_the_handle_is_turned(
    simulate: Simulate, direction: str
) -> None:
    sign = DIRECTIONS[direction]
    simulation = simulate(direction=direction)
    force(simulation, sign * 50.0, 1.0)
    assert abs(hinge(simulation)) < 0.003
    force(simulation, sign * 50.0, 0.2, hold=-0.3)  # not far enough
    assert abs(hinge(simulation)) < 0.003
    force(simulation, sign * 50.0, 0.5, hold=TURNED)
    assert sign * hinge(simulation) > 0.1


@pytest.mark.parametrize("direction", DIRECTIONS)
def test_stop_is_one_sided(simulate: Simulate, direction: str) -> None:
    sign = DIRECTIONS[direction]
    simulation = simulate(direction=direction)
    force(simulation, -sign * 100.0, 1.0, hold=TURNED)
    assert abs(hinge(simulation)) < 0.01
    widest = 0.0
    for _ in range(60):
        force(simulation, sign * 30.0, 0.1, hold=TURNED)
        widest = max(widest, sign * hinge(simulation))
    assert widest == pytest.approx(1.57, abs=0.05)


def test_spring_returns_the_handle_and_the_latch_catches_again(
    simulate: Simulate,
) -> None:
    simulation = simulate(direction="push")
    door = simulation.door
    assert door is not None
    force(simulation, 20.0, 0.4, hold=TURNED)
    opened = door.state().hinge
    assert opened > 0.02
    simulation.run(1.0)
    assert door.state().handle == pytest.approx(0.0, abs=0.01)
    assert door.state().hinge > 0.02
    force(simulation, -40.0, 2.0)
    assert abs(door.state().hinge) < 0.01
    force(simulation, 50.0, 1.0)
    assert abs(door.state().hinge) < 0.01


def test_friction_stops_the_swinging_door(simulate: Simulate) -> None:
    simulation = simulate(direction="push")
    force(simulation, 20.0, 0.3, hold=TURNED)
    simulation.run(5.0)
    assert simulation.door is not None
    state = simulation.door.state()
    assert 0.02 < state.hinge < 1.5 and abs(state.hinge_velocity) < 1e-3


def test_handle_sits_where_the_model_has_it(simulate: Simulate) -> None:
    values = [0.2, -0.3, 0.4, 0.1, -0.1, 0.03, 0.05]
    simulation = simulate(values=values)
    simulation.run(0.5)
    model, door = simulation.scenario.model, simulation.door
    assert door is not None
    cubes = model.unit_cubes(values[:3], values[3:])
    for link, cube in zip((PANEL_LINK, HANDLE_LINK), cubes, strict=True):
        centre = simulation.physics.getLinkState(door.body, link)[0]
        np.testing.assert_allclose(centre, cube[:3, 3], atol=1e-3)


def test_frame_and_wall_leave_the_panel_free(simulate: Simulate) -> None:
    simulation = simulate(frame=True, wall=True, direction="pull")
    force(simulation, -30.0, 1.5, hold=TURNED)
    assert hinge(simulation) < -0.3


def test_surroundings_are_seen_where_they_are_asked_for(
    simulate: Simulate,
) -> None:
    seen = []
    for frame, wall in itertools.product((False, True), repeat=2):
        simulation = simulate(frame=frame, wall=wall, floor=False)
        depth = render(simulation.unit_cubes(), simulation.scenario.model.camera)
        seen.append(int(np.isfinite(depth).sum()))
    assert seen[0] < seen[1] < seen[3] or seen[0] < seen[2] < seen[3]
