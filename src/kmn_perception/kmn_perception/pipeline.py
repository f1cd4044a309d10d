"""From what a camera measured to the morphing parameters of the object that it sees."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from kmn_perception.camera import Camera
from kmn_perception.estimator import Estimate, MorphEstimator, Status
from kmn_perception.intrinsics import camera_as_dense, camera_of_points
from kmn_perception.observation import Observation
from kmn_perception.rendering import depth_to_points, render
from kmn_perception.segmentation import SegmentationSettings, remove_background
from kmn_perception.support_plane import SupportPlaneSettings, find_support_plane, pose_above


class CameraPose(str, Enum):
    """Where the pose of the camera in the world comes from."""

    CANONICAL = "canonical"
    GIVEN = "given"
    SUPPORT_PLANE = "support_plane"


@dataclass(frozen=True, eq=False)
class PipelineSettings:
    """How points become those of one object in the world frame.

    Attributes
    ----------
    camera_pose
        The model's canonical one, the given one, or estimated from the support plane.
    given_pose
        (4, 4) optical frame in the world frame, metres.
    plane
        What counts as a support plane.
    background
        The stages of the background removal.
    """

    camera_pose: CameraPose
    given_pose: NDArray[np.float64]
    plane: SupportPlaneSettings
    background: SegmentationSettings


class MorphPipeline:
    """Camera pose, background removal and estimation, one after the other.

    Attributes
    ----------
    estimator, settings
        May be replaced between two estimates.
    """

    def __init__(self, estimator: MorphEstimator, settings: PipelineSettings) -> None:
        self.estimator, self.settings = estimator, settings

    def warm_up(self) -> None:
        """Compile and load all that the first estimate needs, so that it is not slow."""
        model = self.estimator.model
        prototype = model.unit_cubes(np.zeros(len(model.theta)), np.zeros(len(model.gamma)))
        points = depth_to_points(render(prototype, model.camera), model.camera)
        find_support_plane(points, self.settings.plane)
        for cloud in (points, points.reshape(-1, 3)):
            remove_background(cloud, model.camera.pose, np.zeros(3), self.settings.background)
        self.estimator.warm_up()

    def estimate(self, points: NDArray[np.float32], in_world: bool = False) -> Estimate:
        """Estimate the morphing parameters of the object among the points.

        Parameters
        ----------
        points
            (height, width, 3) organised or (N, 3) unorganised points, metres, NaN for none, in
            the camera's optical frame.
        in_world
            The points are in the world frame already.
        """
        observation = self.observe(points, in_world)
        if observation is None:
            plane = self.settings.plane
            reason = (
                f"no support plane: no plane within {np.degrees(plane.max_tilt):.0f} deg of level "
                f"holds {100 * plane.min_fraction:.0f} % of the points"
            )
            return Estimate.none(self.estimator.model, 0, Status.NO_OBJECT, reason)
        return self.estimator.estimate(observation)

    def observe(self, points: NDArray[np.float32], in_world: bool = False) -> Observation | None:
        """Return what is seen of the object; None if the camera's pose cannot be found."""
        pose = self._find_camera_pose(points, in_world)
        if pose is None:
            return None
        background = self.settings.background
        to_world = np.eye(4) if in_world else pose
        seen = remove_background(points, to_world, pose[:3, 3], background)
        floor = background.plane_margin if background.remove_plane else -np.inf
        camera = self._find_camera(points, seen, to_world, pose)
        return Observation(seen, camera, floor)

    def _find_camera(
        self,
        points: NDArray[np.float32],
        seen: NDArray[np.float32],
        to_world: NDArray[np.float64],
        pose: NDArray[np.float64],
    ) -> Camera:
        """Return the camera that an organised cloud shows, else one with the canonical view."""
        if points.ndim == 3:
            to_camera = np.linalg.inv(pose) @ to_world
            camera = camera_of_points(points, to_camera, pose)
            if camera is not None:
                return camera
        return camera_as_dense(seen, replace(self.estimator.model.camera, pose=pose))

    def _find_camera_pose(
        self, points: NDArray[np.float32], in_world: bool
    ) -> NDArray[np.float64] | None:
        canonical = self.estimator.model.camera.pose
        if in_world or self.settings.camera_pose is CameraPose.CANONICAL:
            return canonical
        if self.settings.camera_pose is CameraPose.GIVEN:
            return self.settings.given_pose
        plane = find_support_plane(points, self.settings.plane)
        return None if plane is None else pose_above(plane, canonical)
