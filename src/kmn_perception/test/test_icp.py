"""ICP recovers motions that are known, and is refused where it cannot apply."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from kmn_perception import weights
from kmn_perception.evaluation.icp import align
from kmn_perception.evaluation.methods import MethodError, choose
from kmn_perception.evaluation.settings import EvaluationSettings
from kmn_perception.kinematic_model import KinematicModel
from kmn_perception.network import MorphNetwork
from kmn_perception.rendering import depth_to_cloud, render
from kmn_perception.transformation import rotation_z, transform_points

SMALL = st.floats(-0.02, 0.02)


def untrained(model: KinematicModel) -> weights.Weights:
    network = MorphNetwork(model, [1, 1, 1, 1, 1])
    return weights.Weights(network, network, {})


@settings(deadline=None, max_examples=20)
@given(SMALL, SMALL, SMALL, SMALL)
def test_a_small_rigid_motion_is_recovered(x: float, y: float, z: float, yaw: float) -> None:
    motion = np.eye(4)
    motion[:3, :3], motion[:3, 3] = rotation_z(np.array(yaw)), (x, y, z)
    source = np.random.default_rng(3).uniform(-0.5, 0.5, size=(300, 3)).astype(np.float32)
    found = align(source, transform_points(motion, source), iterations=100)
    np.testing.assert_allclose(found, motion, atol=1e-5)


@pytest.mark.parametrize(
    ("name", "truth"), [("box_a", [0.03, -0.02]), ("box_b", [0.02, -0.01, 0.1])]
)
def test_theta_of_a_box_near_the_prototype_is_read_back(name: str, truth: list[float]) -> None:
    model = KinematicModel.load(name)
    depth = render(model.unit_cubes(truth, ()), model.camera)
    method = choose(["icp"], model, untrained(model), EvaluationSettings.load())["icp"]
    first, last = method.estimates(depth_to_cloud(depth, model.camera))
    np.testing.assert_array_equal(first, 0.0)
    np.testing.assert_allclose(last, truth, atol=0.01)


@pytest.mark.parametrize("name", ["box_c", "box", "door"])
def test_models_that_no_rigid_motion_morphs_are_refused_or_left_out(name: str) -> None:
    model, comparison = KinematicModel.load(name), EvaluationSettings.load()
    with pytest.raises(MethodError, match=f"icp does not apply to '{name}': it has scales or"):
        choose(["icp"], model, untrained(model), comparison)
    assert list(choose(None, model, untrained(model), comparison)) == ["baseline", "kmn"]
