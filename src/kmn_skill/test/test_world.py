"""The planner's world is the PR2 of its model, before the door of the kinematic model."""

from __future__ import annotations

import numpy as np
import pytest
import robotic as ry

from kmn_perception.model.kinematic_model import KinematicModel
from kmn_skill.planning.clearance import Box, Surface, box_distance, clearance, sample_surface
from kmn_skill.planning.planning_setup import PlanningSetup
from kmn_skill.planning.robot_frames import boxes, surfaces
from kmn_skill.planning.world import PADS, TOOL, World, object_body

VALUES = np.array([0.3, -0.5, 0.7, -0.2, 0.15, 0.02, -0.06])


@pytest.fixture(scope="module")
def model() -> KinematicModel:
    return KinematicModel.load("door")


@pytest.fixture(scope="module")
def world(model: KinematicModel) -> World:
    return World(PlanningSetup.load(model), *model.split(VALUES))


def test_the_joints_are_those_of_joint_states_and_of_the_door(world: World) -> None:
    assert world.joint_names[:3] == ("base_x", "base_y", "base_yaw")
    assert world.joint_names[-2:] == ("hinge", "handle")
    assert len(world.joint_names) == 13


@pytest.mark.parametrize("seed", range(5))
def test_the_robot_moves_as_in_the_full_model(world: World, seed: int) -> None:
    robot = world.setup.robot
    full = ry.Config()
    full.addFile(ry.raiPath(robot.source))
    full.selectJoints(list(robot.model_joints))
    positions = np.random.default_rng(seed).uniform(-0.5, 0.5, 13)
    positions[10] = abs(positions[10])
    full.setJointState(positions[:11])
    frames = [*robot.model_joints, *robot.gripper.followers]
    poses = world.poses(positions[None], frames)[0]
    for name, pose in zip(frames, poses, strict=True):
        assert pose == pytest.approx(full.getFrame(name).getTransform(), abs=1e-9)


@pytest.mark.parametrize("angles", [(0.0, 0.0), (-0.9, -0.7), (1.2, -0.3)])
def test_the_door_moves_as_the_kinematic_model(
    world: World, model: KinematicModel, angles: tuple[float, float]
) -> None:
    frames = [object_body(body.name) for body in model.bodies]
    poses = world.poses(np.array([[*np.zeros(11), *angles]]), frames)[0]
    gamma = model.split(VALUES)[1]
    for pose, cube, body in zip(
        poses,
        model.moved_cubes(VALUES, dict(zip(("hinge", "handle"), angles, strict=True))),
        model.bodies,
        strict=True,
    ):
        assert pose[:3, :3] * body.size(gamma) == pytest.approx(cube[:3, :3], abs=1e-9)
        assert pose[:3, 3] == pytest.approx(cube[:3, 3], abs=1e-9)


def test_the_limits_are_those_of_the_models(world: World, model: KinematicModel) -> None:
    low, high = world.limits()
    assert (low[11], high[11]) == model.joints[0].limits
    assert (low[10], high[10]) == (0.0, 0.548)
    assert np.isinf(low[[7, 9]]).all()  # forearm and wrist roll on and on


def test_the_pads_touch_a_handle_of_its_height(world: World, model: KinematicModel) -> None:
    positions = np.zeros((1, 13))
    positions[0, 10] = world.touching
    left, right, tool = world.poses(positions, [*PADS, TOOL])[0, :, :3, 3]
    height = model.bodies[1].size(model.split(VALUES)[1])[2]
    assert np.linalg.norm(left - right) == pytest.approx(height, abs=1e-6)
    assert tool == pytest.approx((left + right) / 2.0, abs=1e-9)


def test_the_boxes_contain_the_surfaces(world: World) -> None:
    robot = world.setup.robot
    parts = surfaces(robot, 0.02)
    for name, box in boxes(robot).items():
        distances = box_distance(parts[name].points - box.centre, box.size)
        assert distances.max() < 1e-9
        assert distances.max() > -0.001  # and touch them


def test_the_distance_to_a_box_is_that_to_its_nearest_point() -> None:
    points = np.random.default_rng(0).uniform(-1.0, 1.0, (1000, 3))
    size = np.array([0.4, 0.8, 1.2])
    nearest = np.clip(points, -size / 2.0, size / 2.0)
    outside = np.linalg.norm(points - nearest, axis=1)
    distances = box_distance(points, size)
    assert np.maximum(distances, 0.0) == pytest.approx(outside)
    assert (distances[outside == 0.0] <= 0.0).all()


def test_the_samples_of_a_surface_are_dense() -> None:
    vertices = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    points = sample_surface(vertices, np.array([[0, 1, 2]]), 0.05)
    generator = np.random.default_rng(0)
    weights = generator.dirichlet((1.0, 1.0, 1.0), 200)
    gaps = np.linalg.norm((weights @ vertices)[:, None] - points, axis=2).min(axis=1)
    assert gaps.max() < 0.1
    assert points[:, 2] == pytest.approx(0.0)


def test_the_clearance_of_two_boxes_face_to_face_is_their_gap() -> None:
    corners = np.array([[x, y, z] for x in (-0.1, 0.1) for y in (-0.1, 0.1) for z in (-0.1, 0.1)])
    apart, poses = np.eye(4), np.array([np.eye(4), np.eye(4)])
    apart[0, 3] = 0.33
    poses[0, 0, 3], poses[1] = 5.0, apart
    box = Box("box", np.zeros(3), np.full(3, 0.4))
    assert clearance(Surface.of("part", corners), poses, box) == pytest.approx(0.03)


def test_the_clearance_is_that_of_the_nearest_of_all_points_at_all_times() -> None:
    generator = np.random.default_rng(0)
    box = Box("box", np.array([0.1, 0.0, -0.1]), np.array([0.4, 0.8, 1.2]))
    points = generator.uniform(-0.1, 0.1, (50, 3))
    for distance in (0.1, 0.5, 0.8, 1.2):
        poses = np.broadcast_to(np.eye(4), (30, 4, 4)).copy()
        poses[:, :3, :3] = np.linalg.qr(generator.normal(size=(30, 3, 3)))[0]
        poses[:, :3, 3] = generator.uniform(-distance, distance, (30, 3))
        moved = np.einsum("nij,pj->npi", poses[:, :3, :3], points) + poses[:, None, :3, 3]
        nearest = float(box_distance(moved - box.centre, box.size).min())
        found = clearance(Surface.of("part", points), poses, box, reach=0.3)
        assert found == pytest.approx(min(nearest, 0.3))
