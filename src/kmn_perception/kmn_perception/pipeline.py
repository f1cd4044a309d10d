"""From what a camera measured to the morphing parameters of the objects that it sees."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import Enum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kmn_perception.estimator import Estimate, MorphEstimator, Status
from kmn_perception.model.camera import Camera
from kmn_perception.model.observation import Observation
from kmn_perception.model.rendering import depth_to_points, render
from kmn_perception.scene.free_space import free_space, free_space_of_cloud, is_truncated
from kmn_perception.scene.intrinsics import camera_as_dense, camera_of_points
from kmn_perception.scene.object_settings import ObjectSettings
from kmn_perception.scene.occlusion import find_occluded_pairs
from kmn_perception.scene.segmentation import SegmentationSettings, segment
from kmn_perception.scene.stacking import stands_on
from kmn_perception.scene.support_plane import SupportPlaneSettings, find_support_plane, pose_above

UPSIDE_DOWN = np.array([-1.0, -1.0, 1.0], dtype=np.float32)
MIN_TO_PART = 3  # two parts and what is in front of them


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
    objects
        How objects are told apart.
    """

    camera_pose: CameraPose
    given_pose: NDArray[np.float64]
    plane: SupportPlaneSettings
    background: SegmentationSettings
    objects: ObjectSettings


class NoCameraPoseError(ValueError):
    """The camera's pose cannot be found; the text says why."""


class ObjectView(NamedTuple):
    """What is seen of an object.

    Attributes
    ----------
    observation
        Its points, and what is known around them.
    mask
        (height, width), or (N,) for unorganised points: which ones they are.
    truncated
        The object goes on where nothing is seen: beyond the image's border.
    """

    observation: Observation
    mask: NDArray[np.bool_]
    truncated: bool


class ObjectEstimate(NamedTuple):
    """An estimate with what it rests on, see `ObjectView`."""

    estimate: Estimate
    observation: Observation
    mask: NDArray[np.bool_]
    truncated: bool


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
        # At any angle that is not 0 the surface's rounding errors have concave edges.
        split = replace(self.settings.background, cluster=True, cluster_concave_angle=1e-9)
        for cloud in (points, points.reshape(-1, 3)):
            segment(cloud, model.camera.pose, np.zeros(3), split)
        labels = np.zeros(points.shape[:-1], dtype=np.int32)
        around = free_space(points, labels, np.eye(4), model.camera.pose, 0.0, 0)
        mask = np.isfinite(points[..., 2])
        is_truncated(mask, around.free_depth)
        find_occluded_pairs([mask], around.free_depth)
        self.estimator.warm_up()

    def estimate(self, points: NDArray[np.float32], in_world: bool = False) -> Estimate:
        """Estimate the morphing parameters of the nearest object among the points.

        Parameters
        ----------
        points
            (height, width, 3) organised or (N, 3) unorganised points, metres, NaN for none, in
            the camera's optical frame.
        in_world
            The points are in the world frame already.
        """
        return self.estimate_all(points, in_world, 1)[0].estimate

    def estimate_all(
        self, points: NDArray[np.float32], in_world: bool = False, most: int | None = None
    ) -> list[ObjectEstimate]:
        """Estimate the morphing parameters of ``most`` or all objects, the nearest first.

        The other parameters are those of `estimate`.

        Returns
        -------
        objects
            One or more: where there is no object, a single one says why.
        """
        model = self.estimator.model
        try:
            views, reason = self.observe(points, in_world, most), "no points of an object"
        except NoCameraPoseError as error:
            views, reason = [], str(error)
        if not views:
            nothing = np.zeros(points.shape[:-1], dtype=np.bool_)
            none = Estimate.none(model, 0, Status.NO_OBJECT, reason)
            empty = Observation(np.empty((0, 3), np.float32), model.camera)
            return [ObjectEstimate(none, empty, nothing, False)]
        views = self._rejoined(views)
        estimates = self.estimator.estimate_all([view.observation for view in views])
        objects = [
            ObjectEstimate(estimate, *view) for estimate, view in zip(estimates, views, strict=True)
        ]
        return [self._unless_stacked(found, objects) for found in objects]

    def observe(
        self, points: NDArray[np.float32], in_world: bool = False, most: int | None = None
    ) -> list[ObjectView]:
        """Return what is seen of the objects, ``most`` or all of them, the nearest first.

        Those that are too small to be estimated come last.

        Raises
        ------
        NoCameraPoseError
            If the camera's pose cannot be found.
        """
        pose = self.camera_pose(points, in_world)
        background = self.settings.background
        to_world = np.eye(4) if in_world else pose
        segments = segment(points, to_world, pose[:3, 3], background)
        floor = background.plane_margin if background.remove_plane else -np.inf
        labels = segments.labels.reshape(points.shape[:-1])
        camera = self._find_camera(points, to_world, pose)
        if camera is not None:
            to_camera = camera.world_to_camera @ to_world
            border_run = self.settings.objects.border_run
            around = free_space(points, labels, to_camera, to_world, floor, border_run)
        views = []
        sizes = np.bincount(segments.labels + 1, minlength=segments.objects + 1)[1:]
        too_small = sizes < self.estimator.settings.min_points
        for label in np.argsort(too_small, kind="stable")[:most]:
            seen, mask = segments.of_object(label), labels == label
            if camera is not None:
                truncated = is_truncated(mask, around.free_depth)
                views.append(ObjectView(Observation(seen, camera, floor, around), mask, truncated))
            else:
                sensor = self._canonical_view(seen, pose)
                beside = free_space_of_cloud(segments.points, sensor, floor)
                views.append(ObjectView(Observation(seen, sensor, floor, beside), mask, False))
        return views

    def camera_pose(
        self, points: NDArray[np.float32], in_world: bool = False
    ) -> NDArray[np.float64]:
        """Return the pose (4, 4) of the optical frame in the world frame.

        Raises
        ------
        NoCameraPoseError
            If it is to be found from the support plane, and there is none.
        """
        canonical = self.estimator.model.camera.pose
        if in_world or self.settings.camera_pose is CameraPose.CANONICAL:
            return canonical
        if self.settings.camera_pose is CameraPose.GIVEN:
            return self.settings.given_pose
        plane = find_support_plane(points, self.settings.plane)
        if plane is None:
            raise NoCameraPoseError(self._why_no_plane(points))
        return pose_above(plane, canonical)

    def _why_no_plane(self, points: NDArray[np.float32]) -> str:
        settings = self.settings.plane
        reason = (
            f"no support plane: no plane within {np.degrees(settings.max_tilt):.0f} deg of level "
            f"holds {100 * settings.min_fraction:.0f} % of the points"
        )
        if find_support_plane(points * UPSIDE_DOWN, settings) is not None:
            reason += ", but one does in the image turned by 180 deg: the camera is upside down"
        return reason

    def _rejoined(self, views: list[ObjectView]) -> list[ObjectView]:
        """Join what something in front parts in the image, if one model explains both parts."""
        around, mask = views[0].observation.free_space, views[0].mask
        if around is None or mask.shape != around.free_depth.shape or len(views) < MIN_TO_PART:
            return views  # unorganised points have no image in which anything could part them
        owner = list(range(len(views)))  # the first of the parts to which a view belongs
        for a, b in find_occluded_pairs([view.mask for view in views], around.free_depth):
            first, second = sorted((owner[a], owner[b]))
            joined = None if first == second else self._joined(views[first], views[second])
            if joined is not None:
                views = [joined if i == first else view for i, view in enumerate(views)]
                owner = [first if i == second else i for i in owner]
        return [view for i, view in enumerate(views) if owner[i] == i]

    def _joined(self, a: ObjectView, b: ObjectView) -> ObjectView | None:
        """Return two views as one, if their tops are level and one model explains them."""
        parts = (a.observation.points, b.observation.points)
        settings = self.settings.objects
        heights = [np.quantile(points[:, 2], settings.top) for points in parts]
        if abs(heights[0] - heights[1]) > settings.same_height:
            return None
        observation = replace(a.observation, points=np.concatenate(parts))
        if self.estimator.estimate(observation).status is not Status.OK:
            return None
        return ObjectView(observation, a.mask | b.mask, a.truncated or b.truncated)

    def _unless_stacked(
        self, found: ObjectEstimate, objects: Sequence[ObjectEstimate]
    ) -> ObjectEstimate:
        """Refuse the estimate of an object that stands on another one."""
        points, cubes = found.observation.points, self._bodies(found)
        for other in objects:
            if other is not found and stands_on(points, cubes, self._bodies(other)):
                reason = "the object stands on another one, not on the support plane"
                status = Status.NOT_CONVERGED
                return found._replace(
                    estimate=replace(found.estimate, status=status, reason=reason, converged=False)
                )
        return found

    def _bodies(self, found: ObjectEstimate) -> NDArray[np.float64]:
        """Return the bodies (B, 4, 4) of an estimate that holds, else none."""
        estimate = found.estimate
        if estimate.status is not Status.OK:
            return np.empty((0, 4, 4))
        return self.estimator.model.unit_cubes(estimate.theta, estimate.gamma)

    def _find_camera(
        self,
        points: NDArray[np.float32],
        to_world: NDArray[np.float64],
        pose: NDArray[np.float64],
    ) -> Camera | None:
        """Return the camera that an organised cloud shows, if it does."""
        if points.ndim != 3:
            return None
        return camera_of_points(points, np.linalg.inv(pose) @ to_world, pose)

    def _canonical_view(self, seen: NDArray[np.float32], pose: NDArray[np.float64]) -> Camera:
        """Return a camera with the canonical view, as fine as an object's points are dense."""
        return camera_as_dense(seen, replace(self.estimator.model.camera, pose=pose))
