"""The messages that show estimates."""

from __future__ import annotations

import numpy as np
from std_msgs.msg import Header

from kmn_perception.estimate import Estimate, Status
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.ros.messages import markers_from_estimates

BOX = KinematicModel.load("box")


def drawn(**theta: float) -> list[list[float]]:
    """Return the sizes of the cubes that show a box whose other parameters are 0."""
    values = np.array([theta.get(parameter.name, 0.0) for parameter in BOX.theta])
    estimate = Estimate.none(BOX, 0, Status.NOT_CONVERGED, "no fit")
    bodies = BOX.unit_cubes(values, np.zeros(len(BOX.gamma)))
    _, *cubes = markers_from_estimates([(estimate, bodies)], Header()).markers
    return [[cube.scale.x, cube.scale.y, cube.scale.z] for cube in cubes]


def test_a_box_is_drawn_in_its_size_and_one_without_a_size_is_not() -> None:
    (prototype,) = drawn()
    assert drawn(x_scaling=0.5) == [[1.5 * prototype[0], *prototype[1:]]]
    assert drawn(x_scaling=-1.0) == []
