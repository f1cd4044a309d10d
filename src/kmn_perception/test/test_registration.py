"""Registrations recover motions that are known, and have a row for every model."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from kmn_perception.evaluation.methods import choose
from kmn_perception.evaluation.networks import load_networks
from kmn_perception.evaluation.registration import (
    Aligner,
    centre_to_centre,
    gicp,
    point_to_plane,
    point_to_point,
)
from kmn_perception.evaluation.settings import EvaluationSettings
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.model.observation import Observation
from kmn_perception.model.rendering import depth_to_cloud, render
from kmn_perception.model.transformation import rotation_z, transform_points

SETTINGS = EvaluationSettings.load()
SMALL = st.floats(-0.02, 0.02)


def corner() -> NDArray[np.float32]:
    """Return points on three walls that meet in a corner, which no sliding leaves the same."""
    points = np.random.default_rng(3).uniform(0.0, 0.5, size=(900, 3)).astype(np.float32)
    for axis in range(3):
        points[axis::3, axis] = 0.0
    return points


def motion(x: float, y: float, z: float, yaw: float) -> NDArray[np.float64]:
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = rotation_z(np.array(yaw)), (x, y, z)
    return matrix


@settings(deadline=None, max_examples=10)
@given(SMALL, SMALL, SMALL, SMALL)
def test_point_to_point_recovers_a_small_rigid_motion(
    x: float, y: float, z: float, yaw: float
) -> None:
    """Points fill a volume, so that each finds the point that it was."""
    source = np.random.default_rng(3).uniform(-0.5, 0.5, size=(300, 3)).astype(np.float32)
    align = point_to_point(transform_points(motion(x, y, z, yaw), source), SETTINGS.icp)
    np.testing.assert_allclose(align(source, np.eye(4)), motion(x, y, z, yaw), atol=1e-4)


@pytest.mark.parametrize(
    ("aligner", "tolerance"),
    [
        (lambda target: point_to_plane(target, SETTINGS.icp), 1e-4),
        (lambda target: gicp(target, SETTINGS.small_gicp), 5e-3),
    ],
)
def test_surfaces_are_moved_onto_themselves(
    aligner: Callable[[NDArray[np.float32]], Aligner], tolerance: float
) -> None:
    source, moved = corner(), motion(0.03, -0.02, 0.01, 0.05)
    align = aligner(transform_points(moved, source))
    np.testing.assert_allclose(align(source, np.eye(4)), moved, atol=tolerance)


def test_centres_meet() -> None:
    source = corner()
    target = transform_points(motion(1.0, -2.0, 0.5, 0.0), source)
    np.testing.assert_allclose(centre_to_centre(source, target)[:3, 3], [1.0, -2.0, 0.5], atol=1e-5)


@pytest.mark.parametrize(
    ("name", "truth"), [("box_a", [0.03, -0.02]), ("box_b", [0.02, -0.01, 0.1])]
)
def test_theta_of_a_box_near_the_prototype_is_read_back(name: str, truth: list[float]) -> None:
    model = KinematicModel.load(name)
    cloud = depth_to_cloud(render(model.unit_cubes(truth, ()), model.camera), model.camera)
    methods, _ = choose(("icp", "icp_identity"), model, load_networks(model), SETTINGS)
    for method in methods.values():
        *_, last = method.estimates(Observation(cloud, model.camera))
        np.testing.assert_allclose(last.values, truth, atol=0.01)


@pytest.mark.parametrize("name", ["icp", "icp_plane", "small_gicp"])
def test_scales_and_gamma_stay_the_prototypes_and_theta_within_its_limits(name: str) -> None:
    """A door far aside, lower than the prototype, along whose front everything slides."""
    model = KinematicModel.load("door")
    truth = np.array([0.7, -0.7, 1.0, -0.2, 0.1, 0.0, 0.0])
    depth = render(model.unit_cubes(*model.split(truth)), model.camera)
    methods, _ = choose((name,), model, load_networks(model), SETTINGS)
    observation = Observation(depth_to_cloud(depth, model.camera), model.camera)
    for estimate in methods[name].estimates(observation):
        assert (model.limits[:, 0] <= estimate.values).all()
        assert (estimate.values <= model.limits[:, 1]).all()
        np.testing.assert_array_equal(estimate.values[3:], 0.0)
