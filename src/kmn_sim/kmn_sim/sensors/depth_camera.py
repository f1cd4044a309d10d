"""The simulated depth camera: where it is, and what it measures."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from kmn_perception.model.camera import Camera
from kmn_perception.model.transformation import rotation_z
from kmn_sim.sensors.kinect import Kinect, KinectSettings
from kmn_sim.world.simulation import Simulation

MOUNTS = ("world", "base")


class DepthCamera:
    """A depth camera that stands in the world or moves with the robot's base.

    Parameters
    ----------
    camera
        Intrinsics, and the pose in the world or in the base's frame.
    mount
        ``world`` or ``base``.
    noise
        ``none`` or ``kinect``.
    seed
        Of the noise.
    """

    def __init__(self, camera: Camera, mount: str, noise: str, seed: int) -> None:
        self._camera, self._mount = camera, mount
        self._kinect = Kinect(KinectSettings.load(), seed) if noise == "kinect" else None

    def camera(self, simulation: Simulation) -> Camera:
        """Return the camera where it is at present, in the world."""
        if self._mount == "world":
            return self._camera
        x, y, yaw = simulation.robot.state().positions[:3]
        base = np.eye(4)
        base[:3, :3], base[:3, 3] = rotation_z(yaw), (x, y, simulation.floor)
        return replace(self._camera, pose=base @ self._camera.pose)

    def capture(self, simulation: Simulation) -> NDArray[np.float32]:
        """Return the depth image (height, width) at present, metres, NaN for none."""
        exact = simulation.renderer.render(self.camera(simulation)).depth
        return exact if self._kinect is None else self._kinect.measure(exact, self._camera.fx)
