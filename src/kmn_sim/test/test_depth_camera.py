"""Rendered depth against exact ray casting, and the noise against real frames."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from kmn_perception.camera import Camera
from kmn_perception.kinematic_model import KinematicModel
from kmn_perception.rendering import render
from kmn_perception.resources import share_directory
from kmn_sim.clipping import nearest_depth
from kmn_sim.depth_camera import DepthCamera
from kmn_sim.kinect import measure
from kmn_sim.renderer import RENDERERS
from kmn_sim.scenario import Scenario
from kmn_sim.simulation import Simulation

Simulate = Callable[..., Simulation]
MODELS: dict[str, Any] = {"door": {"frame": True}, "box_c": {"table": True}, "box_a": {}}


@pytest.fixture(scope="module", params=RENDERERS)
def simulation(request: pytest.FixtureRequest) -> Simulation:
    model = KinematicModel.load("door")
    return Simulation(Scenario(model, np.zeros(7)), renderer=request.param)


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
        depth = DepthCamera(model.camera, "world", "none", 0).capture(simulation)
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
    head = DepthCamera(Camera.load("pr2_head"), "base", "none", 0)
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


def plane(distance: float) -> NDArray[np.float32]:
    """Return the depth image of a plane that faces the camera."""
    return np.full((120, 160), distance, dtype=np.float32)


@pytest.mark.parametrize(
    ("distance", "expected"), [(0.6, 0.78e-3), (0.8, 1.13e-3), (1.0, 1.76e-3), (1.23, 2.56e-3)]
)
def test_noise_is_of_the_size_measured_on_real_frames(distance: float, expected: float) -> None:
    noisy = measure(plane(distance), "kinect", np.random.default_rng(0))
    assert np.nanstd(noisy) == pytest.approx(expected, rel=0.3)


def test_depth_comes_in_the_steps_of_real_frames() -> None:
    near = 0.95, 1.05
    noisy = np.unique(measure(plane(1.0), "kinect", np.random.default_rng(0)))
    frame: Any = cv2.imread(
        str(share_directory() / "data/kinect_boxes/learn0_d.png"), cv2.IMREAD_UNCHANGED
    )
    steps = []
    for levels in (noisy, np.unique(frame) / 1e3):
        levels = levels[(levels > near[0]) & (levels < near[1])]
        steps.append((1.0 / levels[0] - 1.0 / levels[-1]) / (len(levels) - 1))
    assert steps[0] == pytest.approx(steps[1], rel=0.03)


def test_shadow_lies_to_the_left_and_is_as_wide_as_the_disparity_steps() -> None:
    depth = plane(1.2)
    depth[40:80, 60:100] = 0.8
    shadow = 0.075 * 575.8 * (1 / 0.8 - 1 / 1.2)
    missing = np.zeros(depth.shape)
    for seed in range(20):
        missing += np.isnan(measure(depth, "kinect", np.random.default_rng(seed))) / 20
    beside = missing[45:75].mean(axis=0)
    assert beside[: 60 - int(shadow) - 6].max() < 0.05
    assert beside[60 - int(shadow) + 3 : 57].min() > 0.95
    assert beside[103:].max() < 0.05


def test_the_same_seed_gives_the_same_noise() -> None:
    first, again, other = (
        measure(plane(1.0), "kinect", np.random.default_rng(seed)) for seed in (1, 1, 2)
    )
    np.testing.assert_array_equal(first, again)
    assert (first != other).any()
