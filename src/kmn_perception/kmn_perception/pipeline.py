"""From what a camera measured to the morphing parameters of the objects that it sees."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from kmn_perception.doors.door_tracker import DoorTracker
from kmn_perception.estimate import Estimate, Status
from kmn_perception.estimator import EstimatorSettings
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.model.observation import Observation
from kmn_perception.model.rendering import depth_to_points, render
from kmn_perception.pipeline_interface import Estimator, ObjectEstimate, PipelineSettings
from kmn_perception.scene.camera_pose import NoCameraPoseError, find_camera_pose
from kmn_perception.scene.connected_pixels import share_of_holes
from kmn_perception.scene.depth_view import DepthView
from kmn_perception.scene.free_space import free_space, is_truncated
from kmn_perception.scene.object_view import ObjectView, observe_cloud, observe_image
from kmn_perception.scene.occlusion import find_occluded_pairs
from kmn_perception.scene.segmentation import segment
from kmn_perception.scene.stacking import stands_on
from kmn_perception.scene.standing import Standing, find_standing
from kmn_perception.scene.support_plane import find_support_plane

MIN_PARTS = 3  # two parts of an object, and what is in front of them
TOGETHER = 4  # objects, times models, that are estimated between two looks at the clock


class MorphPipeline:
    """Camera pose, background removal and estimation, one after the other.

    Attributes
    ----------
    estimator, settings
        May be replaced between two estimates.
    """

    def __init__(self, estimator: Estimator, settings: PipelineSettings) -> None:
        self.estimator, self.settings = estimator, settings

    @property
    def model(self) -> KinematicModel:
        """What is estimated; of several models the first."""
        return self.estimator.models[0]

    @property
    def uses_image(self) -> bool:
        """Grey values tell the network nothing."""
        return False

    def configured(self, settings: PipelineSettings, estimator: EstimatorSettings) -> MorphPipeline:
        """Return the pipeline with other settings, which shares models and networks."""
        return MorphPipeline(self.estimator.configured(estimator), settings)

    def warm_up(self) -> None:
        """Compile and load all that the first estimate needs, so that it is not slow."""
        model, scene = self.model, self.settings.scene
        depth = render(model.prototype_cubes, model.camera, model.cylinder_axes)
        points = depth_to_points(depth, model.camera)
        find_support_plane(points, self.settings.plane)
        # At any angle that is not 0 the surface's rounding errors have concave edges.
        split = replace(self.settings.background, cluster=True, cluster_concave_angle=1e-9)
        for cloud in (points, points.reshape(-1, 3)):
            segment(cloud, model.camera.pose, np.zeros(3), split, scene)
        labels = np.zeros(points.shape[:-1], dtype=np.int32)
        around = free_space(points, labels, np.eye(4), model.camera.pose, 0.0, 0, (0.0, 0.0))
        mask = np.isfinite(points[..., 2])
        share_of_holes(points, labels, 1, scene.max_gap)
        find_standing(points, labels, 1, np.array([0.0, 1.0]), 0.0, scene.standing)
        is_truncated(mask, around.free_depth)
        find_occluded_pairs([mask], around.free_depth, scene.occlusion.min_rows)
        self.estimator.warm_up()

    def estimate(self, view: DepthView) -> Estimate:
        """Estimate the morphing parameters of the nearest object of a frame."""
        return self.estimate_all(view, 1)[0].estimate

    def estimate_all(
        self, view: DepthView, max_objects: int | None = None, past: DoorTracker | None = None
    ) -> list[ObjectEstimate]:
        """Estimate the morphing parameters of ``max_objects`` or all objects, the nearest first.

        What the budget of a frame does not allow for is left out, and says so.

        Returns
        -------
        objects
            One or more: where there is no object, a single one says why.
        """
        end = time.monotonic() + self.settings.budget.seconds
        try:
            views, reason = self.observe(view, max_objects), "no points of an object"
        except NoCameraPoseError as error:
            views, reason = [], str(error)
        if not views:
            return [self._nothing(view, reason)]
        objects = self._joined(self._estimated(views, end), end)
        return [self._unless_stacked(found, objects) for found in objects]

    def observe(self, view: DepthView, max_objects: int | None = None) -> list[ObjectView]:
        """Return what is seen of the objects, ``max_objects`` or all of them, the nearest first.

        Those that are too small to be estimated come last.

        Raises
        ------
        NoCameraPoseError
            If the camera's pose cannot be found.
        """
        pose = self.camera_pose(view)
        view = view.placed(pose, self.settings.scene.intrinsics)
        to_world = np.eye(4) if view.in_world else pose
        background, scene = self.settings.background, self.settings.scene
        segments = segment(view.points, to_world, pose[:3, 3], background, scene)
        sizes = np.bincount(segments.labels + 1, minlength=segments.objects + 1)[1:]
        too_small = sizes < self.estimator.settings.min_points
        labels = np.argsort(too_small, kind="stable")[:max_objects].tolist()
        floor = background.plane_margin if background.remove_plane else -np.inf
        if view.camera is None:
            canonical = replace(self.model.camera, pose=pose)
            return [observe_cloud(segments, label, canonical, floor, scene) for label in labels]
        return observe_image(view, view.camera, segments, labels, to_world, floor, scene)

    def camera_pose(self, view: DepthView) -> NDArray[np.float64]:
        """Return the pose (4, 4) of the optical frame in the world, see `find_camera_pose`."""
        settings, source = self.settings, self.settings.camera_pose
        poses = [model.camera.pose for model in self.estimator.models]
        canonical = poses[0] if all(np.array_equal(pose, poses[0]) for pose in poses) else None
        return find_camera_pose(view, source, settings.given_pose, canonical, settings.plane)

    def _nothing(self, view: DepthView, reason: str) -> ObjectEstimate:
        """Return what a frame without an object holds."""
        none = Estimate.none(self.model, 0, Status.NO_OBJECT, reason)
        empty = Observation(np.empty((0, 3), np.float32), self.model.camera)
        return ObjectEstimate(none, empty, np.zeros_like(view.valid), False)

    def _estimated(self, views: Sequence[ObjectView], end: float) -> list[ObjectEstimate]:
        """Estimate the objects one after another, as many as the budget of the frame allows for."""
        budget, objects = self.settings.budget, list[ObjectEstimate]()
        together = max(TOGETHER // len(self.estimator.models), 1)
        for first in range(0, min(len(views), budget.objects), together):
            if first > 0 and time.monotonic() > end:
                break
            some = views[first : min(first + together, budget.objects)]
            estimates = self.estimator.estimate_all([view.observation for view in some])
            objects += [ObjectEstimate(e, *view) for e, view in zip(estimates, some, strict=True)]
        reason = f"{len(objects)} of {len(views)} objects were estimated"
        return objects + [self._left_out(view, reason) for view in views[len(objects) :]]

    def _left_out(self, view: ObjectView, why: str) -> ObjectEstimate:
        """Return an object for which the budget of the frame did not suffice."""
        count, budget = len(view.observation.points), self.settings.budget
        if count < self.estimator.settings.min_points:  # costs nothing
            return ObjectEstimate(self.estimator.estimate(view.observation), *view)
        reason = f"left out: {why}, a frame has {budget.seconds:g} s for {budget.objects} objects"
        none = Estimate.none(self.model, count, Status.NOT_CONVERGED, reason)
        return ObjectEstimate(none, *view, left_out=True)

    def _joined(self, objects: list[ObjectEstimate], end: float) -> list[ObjectEstimate]:
        """Join what an occluder divides in the image, if one model explains both parts."""
        around = objects[0].observation.free_space
        sparse = any(found.observation.depth is None for found in objects)
        if around is None or sparse or len(objects) < MIN_PARTS:
            return objects  # sparse points have no image in which anything divides them
        owner = list(range(len(objects)))  # the first of the parts to which an object belongs
        pairs = find_occluded_pairs(
            [found.mask for found in objects],
            around.free_depth,
            self.settings.scene.occlusion.min_rows,
        )
        for a, b in pairs:
            first, second = sorted((owner[a], owner[b]))
            if first == second or not self._may_be_one(objects[first], objects[second]):
                continue
            if time.monotonic() > end:
                for part in (first, second):
                    view = ObjectView(*objects[part][1:5])
                    objects[part] = self._left_out(view, "it may be a part of another one")
                continue
            whole = self._as_one(objects[first], objects[second])
            if whole is not None:
                objects = [whole if i == first else found for i, found in enumerate(objects)]
                owner = [first if i == second else i for i in owner]
        return [found for i, found in enumerate(objects) if owner[i] == i]

    def _may_be_one(self, a: ObjectEstimate, b: ObjectEstimate) -> bool:
        """Return whether the tops of two objects, of which none is left out, are level."""
        if a.left_out or b.left_out:
            return False
        settings = self.settings.scene.occlusion
        seen = a.observation.points, b.observation.points
        heights = [np.quantile(points[:, 2], settings.top) for points in seen]
        return bool(abs(heights[0] - heights[1]) <= settings.same_height)

    def _as_one(self, a: ObjectEstimate, b: ObjectEstimate) -> ObjectEstimate | None:
        """Return two objects as one, if one model explains both."""
        first, second = a.observation, b.observation
        assert first.depth is not None and second.depth is not None
        observation = replace(
            first,
            points=np.concatenate((first.points, second.points)),
            depth=np.fmin(first.depth, second.depth),
        )
        estimate = self.estimator.estimate(observation)
        if estimate.status is not Status.OK:
            return None
        standing = min(a.standing, b.standing)
        truncated = a.truncated or b.truncated
        return ObjectEstimate(estimate, observation, a.mask | b.mask, truncated, standing)

    def _unless_stacked(
        self, found: ObjectEstimate, objects: Sequence[ObjectEstimate]
    ) -> ObjectEstimate:
        """Refuse the estimate of an object that stands on another one, whatever that is."""
        points, cubes = found.observation.points, self._likely_bodies(found)
        stacking = self.settings.scene.stacking
        if found.standing is Standing.OBJECT or any(
            other is not found and stands_on(points, cubes, self._likely_bodies(other), stacking)
            for other in objects
        ):
            estimate = found.estimate
            reason = "the object stands on another one, not on the support plane"
            if estimate.status is Status.OK:
                estimate = replace(
                    estimate, status=Status.NOT_CONVERGED, reason=reason, converged=False
                )
            return found._replace(estimate=estimate)
        return found

    def bodies(self, estimate: Estimate) -> NDArray[np.float64]:
        """Return the bodies (B, 4, 4) of an estimate, none where there are no parameters."""
        if not np.isfinite([*estimate.theta, *estimate.gamma]).all():
            return np.empty((0, 4, 4))
        values = np.concatenate([estimate.theta, estimate.gamma])
        return estimate.model.moved_cubes(values, estimate.positions)

    def _likely_bodies(self, found: ObjectEstimate) -> NDArray[np.float64]:
        """Return the bodies (B, 4, 4) of an estimate that lies on the points, OK or not."""
        estimate = found.estimate
        likely = estimate.residual <= self.estimator.settings.max_residual
        return self.bodies(estimate) if likely else np.empty((0, 4, 4))
