"""Rendered depth against exact ray casting, and the noise against real frames."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from kmn_perception.model.camera import Camera
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.model.rendering import render
from kmn_sim.sensors.depth_camera import DepthCamera, mount_error
from kmn_sim.world.clipping import nearest_depth
from kmn_sim.world.renderer import RENDERERS
from kmn_sim.world.scenario import Scenario
from kmn_sim.world.settings import WorldSettings
from kmn_sim.world.simulation import Simulation

Simulate = Callable[..., Simulation]
MODELS: dict[str, Any] = {"door": {"frame": True}, "box_c": {"table": True}, "box_a": {}}


@pytest.fixture(scope="module", params=RENDERERS)
def simulation(request: pytest.FixtureRequest) -> Simulation:
    model = KinematicModel.load("door")
    return Simulation(Scenario(model, np.zeros(7)), WorldSettings.load(), renderer=request.param)


def surface(depth: NDArray[np.float32]) -> NDArray[np.bool_]:
    """Return the pixels whose neighbours lie on the same surface."""
    inner = np.ones(depth.shape, dtype=bool)
    for axis in (0, 1):
        for shift in (-1, 1):
            bend = np.abs(2 * depth - np.roll(depth, 1, axis) - np.roll(depth, -1, axis))
            inner &= np.isfinite(np.roll(depth, shift, axis)) & (bend < 0.005)
    return inner


@pytest.mark.parametrize("name", MODELS)
def test_depth_is_that_of_exact_ray_casting(simulation: Simulation, name: str) -> None:
    model = KinematicModel.load(name)
    for values in model.sample(np.random.default_rng(3), 4):
        simulation.build(Scenario(model, values, **MODELS[name]))
        exact = render(simulation.unit_cubes(), model.camera)
        depth = DepthCamera(model.camera).capture(simulation)
        assert (np.isfinite(depth) != np.isfinite(exact)).mean() < 1e-3
        error = np.abs(depth - exact)[surface(exact)]
        assert error.max() <= 1e-3
        edges = ~surface(exact) & np.isfinite(exact) & np.isfinite(depth)
        assert (np.abs(depth - exact)[edges] > 0.01).sum() < 1e-3 * exact.size


def test_the_renderer_that_was_asked_for_is_used(simulation: Simulation) -> None:
    assert simulation.renderer.name in RENDERERS


def test_the_robot_is_behind_the_camera_and_seen_from_elsewhere(simulate: Simulate) -> None:
    simulation = simulate()
    model = simulation.scenario.model
    seen = simulation.renderer.render(model.camera).depth
    door_and_floor = render(simulation.unit_cubes(), model.camera)
    assert np.nanmin(seen) > np.nanmin(door_and_floor) - 0.002
    back = Camera.load("door")
    back.pose[:3, 3] -= 3.0 * back.pose[:3, 2]
    seen = simulation.renderer.render(back).depth
    assert np.nanmin(seen) < np.nanmin(render(simulation.unit_cubes(), back)) - 0.5


def test_a_camera_on_the_base_moves_with_it(simulate: Simulate) -> None:
    simulation = simulate()
    head = DepthCamera(Camera.load("pr2_head"), "base")
    before = head.camera(simulation).pose
    for joint, value in zip(("base_x", "base_y", "base_yaw"), (-2.0, 0.5, 0.3), strict=True):
        simulation.physics.resetJointState(
            simulation.robot.body, simulation.robot.link(joint), value
        )
    after = head.camera(simulation)
    moved = after.pose @ np.linalg.inv(before)
    assert np.arctan2(moved[1, 0], moved[0, 0]) == pytest.approx(0.3)
    assert after.pose[2, 3] == before[2, 3]
    exact = render(simulation.unit_cubes(), after)
    depth = head.capture(simulation)
    both = np.isfinite(depth) & np.isfinite(exact)
    assert np.median(np.abs(depth - exact)[both]) < 1e-3  # but for the robot's own arms


def test_nothing_that_is_seen_lies_before_the_clipping_plane() -> None:
    camera = Camera.load("door")
    generator = np.random.default_rng(0)
    for _ in range(200):
        centre, size = generator.uniform(-4.0, 4.0, 3), generator.uniform(0.01, 8.0, 3)
        cube = np.eye(4)
        cube[:3, :3], cube[:3, 3] = np.diag(size), centre
        depth = render(cube[None], camera.resized(64, 48))
        bound = nearest_depth(camera, np.array([[centre - size / 2.0, centre + size / 2.0]]))
        if np.isfinite(depth).any():
            assert bound <= np.nanmin(depth) + 1e-6


def test_a_camera_out_of_calibration_measures_from_elsewhere_than_it_tells(
    simulation: Simulation,
) -> None:
    model = KinematicModel.load("door")
    simulation.build(Scenario(model, model.prototype, **MODELS["door"]))
    mounted = mount_error(0.01, np.radians(1.0), 4)
    assert np.linalg.norm(mounted[:3, 3]) == pytest.approx(0.01)
    assert np.trace(mounted[:3, :3]) == pytest.approx(1.0 + 2.0 * np.cos(np.radians(1.0)))
    off = DepthCamera(model.camera, scale=1.01, mounted=mounted)
    assert off.camera(simulation) is model.camera
    there = replace(model.camera, pose=model.camera.pose @ mounted)
    exact = 1.01 * render(simulation.unit_cubes(), there)
    error = np.abs(off.capture(simulation) - exact)[surface(exact)]
    assert error.max() <= 1e-3
