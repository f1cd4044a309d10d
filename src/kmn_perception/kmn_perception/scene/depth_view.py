"""A frame as a depth camera saw it, from the edge where messages come in to the refinement."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from kmn_perception.model.camera import Camera
from kmn_perception.model.rendering import depth_to_points
from kmn_perception.scene.intrinsics import camera_of_points
from kmn_perception.scene.settings import IntrinsicsSettings


@dataclass(frozen=True, eq=False)
class DepthView:
    """What was measured in one exposure, and with which camera.

    Attributes
    ----------
    points
        (height, width, 3) organised or (N, 3) unorganised points, metres, NaN where nothing was
        measured; in the camera's optical frame, or in the world frame.
    camera
        The pinhole camera whose pixels the points are; None where no description of it came with
        the points. Its pose is that of the world frame once it is known.
    in_world
        The points are in the world frame.
    frame
        Name of their frame.
    stamp
        Time of the exposure, nanoseconds.
    intensity
        (height, width) grey values of the same pixels, 0 to 1, if there are any.
    pose
        (4, 4) of their frame in the world frame, where it came with them.
    """

    points: NDArray[np.float32]
    camera: Camera | None = None
    in_world: bool = False
    frame: str = ""
    stamp: int = 0
    intensity: NDArray[np.float32] | None = None
    pose: NDArray[np.float64] | None = None

    @classmethod
    def of_depth(cls, depth: NDArray[np.float32], camera: Camera) -> DepthView:
        """Return the view of a depth image (height, width), metres, NaN for none."""
        return cls(depth_to_points(depth, camera), camera)

    @property
    def is_organised(self) -> bool:
        """Whether the points have rows and columns."""
        return self.points.ndim == 3

    @property
    def valid(self) -> NDArray[np.bool_]:
        """(height, width) or (N,) where something was measured."""
        return np.isfinite(self.points[..., 2])

    def placed(self, pose: NDArray[np.float64], settings: IntrinsicsSettings) -> DepthView:
        """Return the view with its camera at a pose in the world.

        Where no camera came with organised points it is found from them; it stays None where they
        are of no pinhole camera.

        Parameters
        ----------
        pose
            (4, 4) optical frame in the world frame.
        """
        if not self.is_organised:
            return replace(self, camera=None)
        if self.camera is not None:
            return replace(self, camera=replace(self.camera, pose=pose))
        to_camera = np.linalg.inv(pose).astype(np.float64) if self.in_world else np.eye(4)
        found = camera_of_points(self.points, to_camera, settings)
        return replace(self, camera=found and replace(found, pose=pose))

    def depth(self) -> NDArray[np.float32]:
        """Return the depth image (height, width) of organised points, metres, NaN for none."""
        if not self.in_world:
            return self.points[..., 2]
        assert self.camera is not None, "points in the world have depths once the view is placed"
        row = self.camera.world_to_camera[2].astype(np.float32)
        return self.points @ row[:3] + row[3]
