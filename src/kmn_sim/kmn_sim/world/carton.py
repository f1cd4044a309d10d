"""The box in the physics: it stands freely, and can be pushed."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from kmn_perception.model.rotation import quaternion_from_matrix
from kmn_sim.world.cuboids import CARTON
from kmn_sim.world.scenario import Scenario
from kmn_sim.world.settings import CartonSettings


class Carton:
    """A box of a kinematic model with one body, on z = 0.

    Attributes
    ----------
    body
        Number of the body in the physics.
    """

    def __init__(self, physics: Any, scenario: Scenario, settings: CartonSettings) -> None:
        self._physics, self._scenario = physics, scenario
        scenario.model.require_cuboids("the simulator, of what has no joints,")
        cube = scenario.model.unit_cubes(scenario.theta, scenario.gamma)[0]
        size = np.linalg.norm(cube[:3, :3], axis=0)
        half = (size / 2.0).tolist()
        self.body: int = physics.createMultiBody(
            settings.density * size.prod(),
            physics.createCollisionShape(physics.GEOM_BOX, halfExtents=half),
            physics.createVisualShape(physics.GEOM_BOX, halfExtents=half, rgbaColor=CARTON),
            cube[:3, 3].tolist(),
            quaternion_from_matrix(cube[:3, :3] / size).tolist(),
        )
        physics.changeDynamics(self.body, -1, lateralFriction=settings.friction)

    def values(self) -> NDArray[np.float64]:
        """Return the morphing parameters (n + m,), with x, y and yaw of where the box is now."""
        position, quaternion = self._physics.getBasePositionAndOrientation(self.body)
        x_axis = self._physics.getMatrixFromQuaternion(quaternion)[0::3]
        present = {
            ("translation", "x"): position[0],
            ("translation", "y"): position[1],
            ("rotation", "z"): np.arctan2(x_axis[1], x_axis[0]),
        }
        values = self._scenario.values.copy()
        for i, kind in enumerate(self._scenario.model.transformation.kinds):
            values[i] = present.get(kind, values[i])
        return values
