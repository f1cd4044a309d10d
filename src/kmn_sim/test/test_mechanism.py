"""The mechanics of objects: friction, stop, spring and latch."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from kmn_perception.configuration import resources
from kmn_perception.configuration.section import ConfigurationError
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.model.rendering import render
from kmn_sim.world.mechanics import Mechanics
from kmn_sim.world.scenario import ScenarioError
from kmn_sim.world.simulation import Simulation

DIRECTIONS = {"pull": -1.0, "push": 1.0}
TURNED = -0.7
Simulate = Callable[..., Simulation]


def force(simulation: Simulation, newton: float, seconds: float, hold: float | None = None) -> None:
    """Push at the handle along x; ``hold`` keeps the handle at an angle."""
    physics, door = simulation.physics, simulation.mechanism
    assert door is not None
    for _ in range(round(seconds / simulation.step_time)):
        if hold is not None:
            physics.resetJointState(door.body, door.grasped, hold)
        at = physics.getLinkState(door.body, door.grasped)[0]
        physics.applyExternalForce(
            door.body, door.grasped, (newton, 0.0, 0.0), at, physics.WORLD_FRAME
        )
        simulation.step()


def hinge(simulation: Simulation) -> float:
    assert simulation.mechanism is not None
    return simulation.mechanism.positions()["hinge"]


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


def test_the_force_on_the_handle_is_what_pulls_at_it_and_its_weight(simulate: Simulate) -> None:
    simulation = simulate(values=[0.0, 0.0, 0.5, 0.0, 0.0, 0.0, 0.0])  # turned: in the world
    door = simulation.mechanism
    assert door is not None
    weight = (
        Mechanics.of(simulation.scenario.model).bodies["handle"].mass
        * simulation.settings.physics.gravity
    )
    force(simulation, 0.0, 0.5)
    door.grasp_force()
    force(simulation, 0.0, 0.1)
    assert door.grasp_force() == pytest.approx([0.0, 0.0, -weight], abs=0.1)
    force(simulation, 50.0, 0.5)
    door.grasp_force()
    force(simulation, 50.0, 0.1)
    assert door.grasp_force() == pytest.approx([50.0, 0.0, -weight], abs=1.0)


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
    door = simulation.mechanism
    assert door is not None
    force(simulation, 20.0, 0.4, hold=TURNED)
    opened = door.positions()["hinge"]
    assert opened > 0.02
    simulation.run(1.0)
    assert door.positions()["handle"] == pytest.approx(0.0, abs=0.01)
    assert door.positions()["hinge"] > 0.02
    force(simulation, -40.0, 2.0)
    assert abs(door.positions()["hinge"]) < 0.01
    force(simulation, 50.0, 1.0)
    assert abs(door.positions()["hinge"]) < 0.01


def test_friction_stops_the_swinging_door(simulate: Simulate) -> None:
    simulation = simulate(direction="push")
    force(simulation, 20.0, 0.3, hold=TURNED)
    simulation.run(5.0)
    assert simulation.mechanism is not None
    door = simulation.mechanism
    assert 0.02 < door.positions()["hinge"] < 1.5 and abs(door.velocities()["hinge"]) < 1e-3


def test_handle_sits_where_the_model_has_it(simulate: Simulate) -> None:
    values = [0.2, -0.3, 0.4, 0.1, -0.1, 0.03, 0.05]
    simulation = simulate(values=values)
    simulation.run(0.5)
    model, door = simulation.scenario.model, simulation.mechanism
    assert door is not None
    cubes = model.unit_cubes(values[:3], values[3:])
    for link, cube in zip((door.link("hinge"), door.link("handle")), cubes, strict=True):
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


def pull(simulation: Simulation, newton: float, seconds: float) -> dict[str, float]:
    """Pull at what is grasped along -x; return the positions of the joints then."""
    physics, thing = simulation.physics, simulation.mechanism
    assert thing is not None
    for _ in range(round(seconds / simulation.step_time)):
        at = physics.getLinkState(thing.body, thing.grasped)[0]
        physics.applyExternalForce(
            thing.body, thing.grasped, (-newton, 0.0, 0.0), at, physics.WORLD_FRAME
        )
        simulation.step()
    return thing.positions()


def test_a_drawer_slides_as_newton_has_it_and_stops(simulate: Simulate) -> None:
    """Of 10 N friction takes 4, and 4.3 kg are moved: half a second takes them so far."""
    simulation = simulate("drawer")
    found = pull(simulation, 10.0, 0.5)
    assert found["slide"] == pytest.approx(-0.5 * 6.0 / 4.3 * 0.5**2, rel=0.05)
    assert pull(simulation, 10.0, 3.0)["slide"] == pytest.approx(-0.4, abs=0.01)


def test_friction_holds_a_drawer(simulate: Simulate) -> None:
    assert pull(simulate("drawer"), 3.0, 1.0)["slide"] == pytest.approx(0.0, abs=1e-3)


def test_the_seal_of_a_fridge_holds_until_it_gives(simulate: Simulate) -> None:
    simulation = simulate("fridge")
    assert pull(simulation, 30.0, 1.0)["hinge"] == pytest.approx(0.0, abs=0.01)
    assert pull(simulation, 50.0, 1.0)["hinge"] < -0.1
    assert pull(simulation, 10.0, 1.0)["hinge"] < -0.2  # once open it is light


def test_a_lid_falls_shut(simulate: Simulate) -> None:
    simulation = simulate("lid")
    lid = simulation.mechanism
    assert lid is not None
    simulation.physics.resetJointState(lid.body, lid.link("hinge"), -0.7)
    simulation.run(2.0)
    assert lid.positions()["hinge"] == pytest.approx(0.0, abs=0.02)


@pytest.mark.parametrize("name", ["drawer", "cupboard_door", "fridge", "lid"])
def test_bodies_are_where_the_model_has_them(simulate: Simulate, name: str) -> None:
    model = KinematicModel.load(name)
    values = 0.5 * model.limits[:, 1]
    simulation = simulate(name, values)
    simulation.run(0.2)
    thing = simulation.mechanism
    assert thing is not None
    cubes = dict(
        zip([b.name for b in model.bodies], model.unit_cubes(*model.split(values)), strict=True)
    )
    for number, joint in enumerate(model.joints):
        centre = simulation.physics.getLinkState(thing.body, number)[0]
        np.testing.assert_allclose(centre, cubes[joint.body][:3, 3], atol=1e-3)


def test_what_opens_to_one_side_only_is_refused_to_the_other(simulate: Simulate) -> None:
    with pytest.raises(ScenarioError, match="does not open by push"):
        simulate("drawer", direction="push")


def test_a_drawer_has_no_wall_around_it(simulate: Simulate) -> None:
    with pytest.raises(ScenarioError, match="'wall' are for doors"):
        simulate("drawer", wall=True)


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        (None, "needs the 'mechanics'"),
        ({"bodies": {"front": {"mass": 1.0}}, "joints": {}}, "lacks what joints move: bar"),
        ({"bodies": {"front": {"mass": 0.0}}, "joints": {}}, "'mass'"),
        ({"joints": {"slid": {}}}, "joints: unknown slid"),
        (
            {"joints": {"slide": {"latch": {"catch": 0.0, "effort": 1.0, "released_by": "x"}}}},
            "'released_by' of joints: unknown x",
        ),
    ],
)
def test_wrong_mechanics_are_refused(
    tmp_path: Path, changes: dict[str, Any] | None, named: str
) -> None:
    content = yaml.safe_load(resources.find("config/models", "drawer").read_text())
    content["mechanics"] = {} if changes is None else {**content["mechanics"], **changes}
    file = tmp_path / "drawer.yaml"
    file.write_text(yaml.safe_dump(content, sort_keys=False))
    with pytest.raises(ConfigurationError, match=named):
        Mechanics.of(KinematicModel.load(file))
