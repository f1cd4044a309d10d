"""The simulated depth camera: where it is, and what it measures."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

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
    scale
        Factor by which the measured depth is off.
    mounted
        (4, 4) where the camera is in the frame where it should be; None: just there.
    """

    def __init__(
        self,
        camera: Camera,
        mount: str = "world",
        sensor: NoisySensor | None = None,
        scale: float = 1.0,
        mounted: NDArray[np.float64] | None = None,
    ) -> None:
        self._camera, self._mount, self._sensor, self._scale = camera, mount, sensor, scale
        self._mounted = np.eye(4) if mounted is None else mounted

    def camera(self, simulation: Simulation) -> Camera:
        """Return the camera where it should be at present, in the world."""
        if self._mount == "world":
            return self._camera
        return replace(self._camera, pose=simulation.robot.base_pose() @ self._camera.pose)

    def capture(self, simulation: Simulation) -> NDArray[np.float32]:
        """Return the depth image (height, width) at present, metres, NaN for none."""
        return self.expose(simulation).depth

    def expose(self, simulation: Simulation) -> Picture:
        """Return the depth image at present, as measured, and the colours of the same pixels."""
        told = self.camera(simulation)
        picture = simulation.renderer.render(replace(told, pose=told.pose @ self._mounted))
        depth = picture.depth
        if self._sensor is not None:
            depth = self._sensor.measure(depth, self._camera.fx)
        # A renderer's edges have steps, whose pieces line detectors take for lines of their own.
        blur = simulation.settings.physics.blur
        colour = cv2.GaussianBlur(picture.colour, (0, 0), blur).astype(np.uint8, copy=False)
        return Picture(colour, depth * np.float32(self._scale))


def mount_error(offset: float, tilt: float, seed: int) -> NDArray[np.float64]:
    """Return a small motion (4, 4): by so many metres and radians, whereto is drawn by the seed."""
    directions = np.random.default_rng(seed).normal(size=(2, 3))
    ahead, axis = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    motion = np.eye(4)
    motion[:3, :3] = Rotation.from_rotvec(tilt * axis).as_matrix()
    motion[:3, 3] = offset * ahead
    return motion
