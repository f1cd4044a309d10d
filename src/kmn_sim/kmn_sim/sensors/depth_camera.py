"""The simulated depth camera: where it is, and what it measures."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from kmn_perception.model.camera import Camera
from kmn_perception.model.noisy_sensor import NoisySensor
from kmn_sim.world.renderer import Picture
from kmn_sim.world.simulation import Simulation


class DepthCamera:
    """A depth camera that stands in the world or moves with the robot's base.

    Parameters
    ----------
    camera
        Intrinsics, and the pose in the world or in the base's frame.
    mount
        ``world`` or ``base``.
    sensor
        What it makes of the exact depth; None: it measures exactly.
    """

    def __init__(
        self, camera: Camera, mount: str = "world", sensor: NoisySensor | None = None
    ) -> None:
        self._camera, self._mount, self._sensor = camera, mount, sensor

    def camera(self, simulation: Simulation) -> Camera:
        """Return the camera where it is at present, in the world."""
        if self._mount == "world":
            return self._camera
        return replace(self._camera, pose=simulation.robot.base_pose() @ self._camera.pose)

    def capture(self, simulation: Simulation) -> NDArray[np.float32]:
        """Return the depth image (height, width) at present, metres, NaN for none."""
        return self.expose(simulation).depth

    def expose(self, simulation: Simulation) -> Picture:
        """Return the depth image at present, as measured, and the colours of the same pixels."""
        picture = simulation.renderer.render(self.camera(simulation))
        if self._sensor is None:
            return picture
        return picture._replace(depth=self._sensor.measure(picture.depth, self._camera.fx))
