"""The whole world: tracking, effort limits, determinism, boxes, scenarios that are refused."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from kmn_perception.model.depth_sensor import DepthSensor
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.model.noisy_sensor import NoisySensor
from kmn_sim.control.trajectory import Command, Waypoint
from kmn_sim.robot.settings import RobotSettings
from kmn_sim.sensors.depth_camera import DepthCamera
from kmn_sim.world.scenario import Scenario, ScenarioError
from kmn_sim.world.simulation import Simulation

Simulate = Callable[..., Simulation]
ROBOT = RobotSettings.load()
ARM = ROBOT.arm_names
REACH = (0.4, 0.2, 0.8, -1.2, 0.5, -0.9, 1.2)


def arm(simulation: Simulation) -> list[float]:
    """Return the positions of the arm's joints."""
    positions = dict(zip(ROBOT.names, simulation.robot.state().positions, strict=True))
    return [positions[name] for name in ARM]


def reach(simulation: Simulation, seconds: float = 3.0) -> None:
    command = Command(ARM, [Waypoint(seconds, REACH, (0.0,) * 7)])
    simulation.controllers.accept(command, simulation.time)


def test_the_arm_follows_a_trajectory_closely(simulate: Simulate) -> None:
    simulation = simulate()
    reach(simulation)
    largest = 0.0
    for _ in range(round(3.5 / simulation.step_time)):
        simulation.step()
        error = simulation.desired.positions - simulation.robot.state().positions
        largest = max(largest, float(np.abs(error).max()))
    assert largest < 0.01
    np.testing.assert_allclose(arm(simulation), REACH, atol=1e-3)


def test_gravity_is_compensated_in_any_posture(simulate: Simulate) -> None:
    simulation = simulate()
    reach(simulation)
    simulation.run(4.0)
    before = simulation.robot.state().positions
    assert np.abs(simulation.robot.efforts()).max() < 0.5
    simulation.run(1.0)
    np.testing.assert_allclose(simulation.robot.state().positions, before, atol=1e-4)


def test_efforts_stay_within_those_of_the_pr2(simulate: Simulate) -> None:
    simulation = simulate()
    efforts = np.array([motor.effort for motor in ROBOT.joints.values()])
    reach(simulation, seconds=0.1)  # far faster than it can
    for _ in range(120):
        simulation.step()
        assert (np.abs(simulation.robot.efforts()) <= efforts * (1.0 + 1e-6)).all()
    simulation.run(2.0)
    np.testing.assert_allclose(arm(simulation), REACH, atol=0.01)


def test_a_blocked_arm_does_not_go_through_what_blocks_it(simulate: Simulate) -> None:
    simulation = simulate(direction="pull")
    physics, robot = simulation.physics, simulation.robot
    wall = physics.createCollisionShape(physics.GEOM_BOX, halfExtents=(0.05, 2.0, 2.0))
    physics.createMultiBody(0.0, wall, basePosition=(-2.3, 0.0, 1.0))
    command = Command(("base_x",), [Waypoint(2.0, (-2.0,))])
    simulation.controllers.accept(command, 0.0)
    simulation.run(3.0)
    assert robot.state().positions[0] < -2.5


def test_fingers_close_together(simulate: Simulate) -> None:
    simulation = simulate()
    for target in (0.5, 0.05):
        command = Command((ROBOT.gripper.joint,), [Waypoint(1.0, (target,))])
        simulation.controllers.accept(command, simulation.time)
        simulation.run(1.5)
        for name in ROBOT.finger_names:
            link = simulation.robot.link(name)
            angle = simulation.physics.getJointState(simulation.robot.body, link)[0]
            assert angle == pytest.approx(target, abs=0.03), name


def run(simulation: Simulation) -> list[NDArray[Any]]:
    """Return what happens in a run with an arm that moves and a noisy camera."""
    camera = DepthCamera(
        simulation.scenario.model.camera,
        "world",
        NoisySensor(DepthSensor.load("kinect_v1"), seed=5),
    )
    reach(simulation, 0.5)
    seen: list[NDArray[Any]] = []
    for _ in range(3):
        simulation.run(0.2)
        seen += [simulation.robot.state().positions, camera.capture(simulation)]
    return seen


def test_the_same_seed_makes_the_same_run(simulate: Simulate) -> None:
    values = KinematicModel.load("door").sample(np.random.default_rng(2), 1)[0]
    simulation = simulate(values=values)
    first, other = run(simulation), run(simulate(values=values))
    simulation.build(simulation.scenario)
    for one, two, again in zip(first, other, run(simulation), strict=True):
        np.testing.assert_array_equal(one, two)
        if one.ndim == 1:  # at another time, the trajectory's times are rounded otherwise
            np.testing.assert_allclose(one, again, atol=1e-9)


@pytest.mark.parametrize(
    ("model", "start"), [("door", (-3.3, 0.0, 0.0)), ("box_a", (0.0, -1.9, 1.5708))]
)
def test_the_base_starts_at_home_or_before_the_box(
    simulate: Simulate, model: str, start: tuple[float, ...]
) -> None:
    simulation = simulate(model)
    pose = simulation.robot.base_pose()
    found = (*pose[:2, 3], np.arctan2(pose[1, 0], pose[0, 0]))
    np.testing.assert_allclose(found, start, atol=1e-9)
    state = dict(zip(ROBOT.names, simulation.robot.state().positions, strict=True))
    assert [state[name] for name in ROBOT.base_names] == pytest.approx(start)


def test_the_stem_is_that_of_the_kinematic_model(simulate: Simulate) -> None:
    values = [0.0, 0.0, 0.0, 0.0, 0.0, 0.03, 0.05]
    cubes = simulate(values=values, floor=False).unit_cubes()
    without = simulate(values=values, floor=False, stem=False).unit_cubes()
    np.testing.assert_array_equal(cubes[:-1], without)
    stem = KinematicModel.load("door").stem
    assert stem is not None
    centre, size = stem.cuboid(values[3:])
    np.testing.assert_allclose(cubes[-1][:3, 3], centre)
    np.testing.assert_allclose(np.diag(cubes[-1][:3, :3]), size)


@pytest.mark.parametrize("table", [False, True])
@pytest.mark.parametrize("name", ["box_a", "box_b", "box_c"])
def test_a_box_stands_still_where_it_was_put(simulate: Simulate, name: str, table: bool) -> None:
    values = KinematicModel.load(name).sample(np.random.default_rng(4), 1)[0]
    simulation = simulate(name, values, table=table)
    simulation.run(1.0)
    np.testing.assert_allclose(simulation.values(), values, atol=5e-4)


def test_the_truth_of_a_box_that_was_pushed_is_where_it_is(simulate: Simulate) -> None:
    simulation = simulate("box_b")
    carton, physics = simulation.carton, simulation.physics
    assert carton is not None
    physics.resetBasePositionAndOrientation(
        carton.body, (0.1, -0.2, 0.05), physics.getQuaternionFromEuler((0.0, 0.0, 0.3))
    )
    np.testing.assert_allclose(simulation.values(), [0.1, -0.2, 0.3], atol=1e-9)


@pytest.mark.parametrize(
    ("values", "options", "text"),
    [
        ([0.9, 0, 0, 0, 0, 0, 0], {}, "x = 0.9 is outside"),
        ([np.nan, 0, 0, 0, 0, 0, 0], {}, "x = nan is outside"),
        ([0, 0, 0], {}, "has 7 parameters .*found 3"),
        ([0] * 7, {"direction": "sideways"}, "'direction' must be one of pull, push"),
    ],
)
def test_a_scenario_out_of_bounds_is_refused(
    values: list[float], options: dict[str, str], text: str
) -> None:
    with pytest.raises(ScenarioError, match=text):
        Scenario(KinematicModel.load("door"), np.array(values, dtype=float), **options)  # type: ignore[arg-type]
