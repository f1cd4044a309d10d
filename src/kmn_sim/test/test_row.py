"""Objects in one row: where they stand, what cannot stand there, and that each moves by its own."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from numpy.typing import NDArray

from kmn_perception.configuration import resources
from kmn_perception.model.camera import Camera
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.model.rendering import render
from kmn_sim.sensors.depth_camera import DepthCamera
from kmn_sim.world.mechanism import Mechanism
from kmn_sim.world.row import in_row
from kmn_sim.world.scenario import Scenario, ScenarioError
from kmn_sim.world.settings import WorldSettings
from kmn_sim.world.simulation import Simulation

DRAWER = KinematicModel.load("drawer")
OTHERS = ("cupboard_door", "fridge", "drawer", "lid")
GAP = 0.1
Build = Callable[[Scenario], Simulation]


@pytest.fixture
def build() -> Iterator[Build]:
    """Return a function that simulates a scenario."""
    with ExitStack() as stack:
        yield lambda scenario: stack.enter_context(
            closing(Simulation(scenario, WorldSettings.load(), renderer="software"))
        )


def row(
    *names: str,
    theta: tuple[float, ...] = (0.0, 0.0, 0.0),
    seed: int | None = None,
    gap: float = GAP,
) -> Scenario:
    values = np.array([*theta, *np.zeros(len(DRAWER.gamma))])
    models = [KinematicModel.load(name) for name in names]
    generator = None if seed is None else np.random.default_rng(seed)
    return in_row(Scenario(DRAWER, values), models, gap, generator)


def spans(scenario: Scenario, pose: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the lowest and highest corner (2, 3) of an object in the frame of a pose (4, 4)."""
    corners = np.array(np.meshgrid(*[(-0.5, 0.5)] * 3)).reshape(3, -1)
    cubes = np.linalg.inv(pose) @ scenario.model.unit_cubes(scenario.theta, scenario.gamma)
    places = cubes[:, :3, :3] @ corners + cubes[:, :3, 3:]
    return np.array([places.min(axis=(0, 2)), places.max(axis=(0, 2))])


@pytest.mark.parametrize("seed", [None, 0, 1])
@pytest.mark.parametrize("yaw", [-0.5, 0.0, 0.4])
@pytest.mark.parametrize("gap", [0.0, GAP])
def test_they_stand_side_by_side_with_the_gap_between_them_and_their_fronts_flush(
    gap: float, yaw: float, seed: int | None
) -> None:
    scenario = row(*OTHERS, theta=(0.1, -0.2, yaw), seed=seed, gap=gap)
    pose = scenario.model.transformation.matrix(scenario.theta)
    for each in scenario.beside:
        there = np.linalg.inv(pose) @ each.model.transformation.matrix(each.theta)
        assert there[:3, :3] == pytest.approx(np.eye(3))
        assert there[[0, 2], 3] == pytest.approx([0.0, 0.0])
    ends = [spans(each, pose)[:, 1] for each in (scenario, *scenario.beside)]
    in_order = [ends[n] for n in (3, 1, 0, 2, 4)]  # from the right to the left
    gaps = [left[0] - right[1] for right, left in zip(in_order, in_order[1:], strict=False)]
    assert gaps == pytest.approx([gap] * len(OTHERS))


def test_their_sizes_are_the_prototypes_or_drawn_by_seed_within_their_limits() -> None:
    assert all(not each.gamma.any() for each in row(*OTHERS).beside)
    first, again, other = (row(*OTHERS, seed=seed).beside for seed in (3, 3, 4))
    for one, same, different in zip(first, again, other, strict=True):
        assert np.array_equal(one.values, same.values)
        assert not np.isclose(one.gamma, different.gamma).any()
        low, high = one.model.limits[len(one.model.theta) :].T
        assert ((low <= one.gamma) & (one.gamma <= high)).all()


def test_an_object_alone_has_nothing_beside_it() -> None:
    alone = Scenario(DRAWER, DRAWER.prototype)
    assert in_row(alone, [], GAP) is alone


@pytest.mark.parametrize(
    ("model", "name", "options", "problem"),
    [
        ("drawer", "box_a", {}, "model 'box_a' has no 'actions'"),
        ("drawer", "door", {}, "model 'door' is a door that fills an opening of a wall"),
        ("door", "drawer", {}, "model 'door' is a door that fills an opening of a wall"),
        ("box_a", "drawer", {}, "model 'box_a' has no 'actions'"),
        ("drawer", "drawer", {"table": True}, "'table' for a box: leave one out"),
    ],
)
def test_what_cannot_stand_in_a_row_is_refused_with_the_reason(
    model: str, name: str, options: dict[str, Any], problem: str
) -> None:
    kinematic = KinematicModel.load(model)
    with pytest.raises(ScenarioError) as refused:
        in_row(
            Scenario(kinematic, kinematic.prototype, **options), [KinematicModel.load(name)], GAP
        )
    assert "'beside'" in str(refused.value)
    assert problem in str(refused.value)


def test_what_cannot_be_turned_as_the_others_are_is_refused(tmp_path: Path) -> None:
    text = resources.find("config/models", "cupboard_door").read_text(encoding="utf-8")
    file = yaml.safe_load(text)
    file["theta"] = [each for each in file["theta"] if each["kind"] == "translation"]
    path = tmp_path / "fixed.yaml"
    path.write_text(yaml.safe_dump({**file, "name": "fixed"}), encoding="utf-8")
    assert row(str(path)).beside[0].theta == pytest.approx([0.0, -0.625])
    with pytest.raises(ScenarioError, match=r"yaw = 0\.200, to where its theta \(x, y\) cannot"):
        row(str(path), theta=(0.0, 0.0, 0.2))


def pull(simulation: Simulation, mechanism: Mechanism, newton: float) -> None:
    """Pull at what is grasped for half a second, along the object's x."""
    physics = simulation.physics
    yaw = simulation.scenario.theta[2]
    force = (-newton * np.cos(yaw), -newton * np.sin(yaw), 0.0)
    for _ in range(round(0.5 / simulation.step_time)):
        at = physics.getLinkState(mechanism.body, mechanism.grasped)[0]
        physics.applyExternalForce(
            mechanism.body, mechanism.grasped, force, at, physics.WORLD_FRAME
        )
        simulation.step()


@pytest.mark.parametrize("opened", [0, 1, 2])
def test_each_is_opened_by_its_own_while_the_others_rest(build: Build, opened: int) -> None:
    simulation = build(row("cupboard_door", "drawer", theta=(0.0, 0.0, 0.3), gap=0.0))
    assert simulation.mechanism is not None
    mechanisms = (simulation.mechanism, *simulation.beside)
    pull(simulation, mechanisms[opened], 40.0)
    positions = [next(iter(each.positions().values())) for each in mechanisms]
    assert positions[opened] < -0.1
    assert np.abs(np.delete(positions, opened)).max() < 1e-3


def test_the_magnet_of_one_beside_holds_it(build: Build) -> None:
    simulation = build(row("cupboard_door"))
    (cupboard,) = simulation.beside
    pull(simulation, cupboard, 5.0)
    assert cupboard.latched == {"hinge"}
    assert abs(cupboard.positions()["hinge"]) < 0.01


def test_the_camera_sees_all_of_them_and_a_new_scenario_has_its_own(build: Build) -> None:
    simulation = build(row("cupboard_door", "lid", theta=(0.2, 0.1, 0.2), seed=1))
    assert len(simulation.unit_cubes()) == len(simulation.cylinder_axes())
    camera = Camera.load("furniture")
    seen = DepthCamera(camera).capture(simulation)
    told = render(simulation.unit_cubes(), camera)
    for each in simulation.scenario.beside:
        alone = render(each.model.unit_cubes(each.theta, each.gamma), camera)
        shown = alone == told  # where nothing but the robot is before it
        assert shown.sum() > 2000
        assert (np.abs(seen - told)[shown] < 0.005).mean() > 0.7
    simulation.build(Scenario(DRAWER, DRAWER.prototype))
    assert simulation.beside == ()
    simulation.run(0.1)
