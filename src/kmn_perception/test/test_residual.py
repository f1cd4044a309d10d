"""Distances to the surface, against points whose distance is known."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.model.surface_distance import surface_distances
from kmn_perception.model.transformation import transform_points

BOX = KinematicModel.load("box_b")


@given(st.floats(-0.4, 0.4), st.floats(-0.4, 0.4), st.floats(-1.0, 1.0))
def test_distances_do_not_change_with_the_pose(x: float, y: float, yaw: float) -> None:
    """A 0.2 x 0.3 x 0.1 m box: above, beside, inside, and off a corner."""
    local = np.array(
        [
            [0.0, 0.0, 0.13],
            [0.15, 0.1, 0.05],
            [0.0, 0.0, 0.06],
            [0.13, 0.19, 0.1],
            [0.1, 0.0, 0.02],
        ],
        dtype=np.float32,
    )
    theta = [x, y, yaw]
    points = transform_points(BOX.transformation.matrix(theta), local)
    distances = surface_distances(BOX.unit_cubes(theta, []), points)
    np.testing.assert_allclose(distances, [0.03, 0.05, 0.04, 0.05, 0.0], atol=1e-5)


def test_the_nearest_body_counts() -> None:
    door = KinematicModel.load("door")
    points = np.array([[-0.1, -0.305, 1.0], [0.1, 0.0, 1.0]], dtype=np.float32)
    distances = surface_distances(door.unit_cubes(np.zeros(3), np.zeros(4)), points)
    np.testing.assert_allclose(distances, [0.01, 0.081], atol=1e-6)
