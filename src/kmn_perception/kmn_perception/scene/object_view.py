"""What a frame shows of each object: its points, what is around them, and what it stands on."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kmn_perception.model.camera import Camera
from kmn_perception.model.observation import Observation
from kmn_perception.scene.connected_pixels import share_of_holes
from kmn_perception.scene.depth_view import DepthView
from kmn_perception.scene.free_space import free_space, free_space_of_cloud, is_truncated
from kmn_perception.scene.intrinsics import camera_as_dense
from kmn_perception.scene.segmentation import Segments
from kmn_perception.scene.settings import SceneSettings
from kmn_perception.scene.standing import Standing, find_standing, forget_beside


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
    standing
        What it is seen to stand on; unorganised points do not tell.
    """

    observation: Observation
    mask: NDArray[np.bool_]
    truncated: bool
    standing: Standing


def observe_image(
    view: DepthView,
    camera: Camera,
    segments: Segments,
    labels: Sequence[int],
    to_world: NDArray[np.float64],
    floor: float,
    scene: SceneSettings,
) -> list[ObjectView]:
    """Return what is seen of objects in the pixels of a camera.

    Parameters
    ----------
    labels
        Of the objects.
    to_world
        (4, 4) of the view's points.
    floor
        World height up to which points belong to the support, metres; minus infinity: none do.
    """
    image = segments.labels.reshape(view.points.shape[:-1])
    world = segments.points.reshape(view.points.shape)
    to_camera = camera.world_to_camera @ to_world
    shadow = camera.fx * scene.shadow.baseline, scene.shadow.slack
    around = free_space(view.points, image, to_camera, to_world, floor, scene.border_run, shadow)
    standing = [Standing.UNSEEN] * segments.objects
    if np.isfinite(floor):
        down = -camera.world_to_camera[:2, 2]
        standing = find_standing(world, image, segments.objects, down, floor, scene.standing)
        forget_beside(*around, image, standing, scene.standing)
    holes = share_of_holes(view.points, image, segments.objects, scene.max_gap)
    depth = view.depth()
    views = []
    for label in labels:
        mask = image == label
        if holes[label] > 1.0 - scene.intrinsics.dense:
            observation = _sparse(segments, label, camera, floor, scene)
        else:
            seen = np.where(mask, depth, np.float32(np.nan))
            observation = Observation(segments.of_object(label), camera, floor, around, seen)
        truncated = is_truncated(mask, around.free_depth)
        views.append(ObjectView(observation, mask, truncated, standing[label]))
    return views


def observe_cloud(
    segments: Segments, label: int, camera: Camera, floor: float, scene: SceneSettings
) -> ObjectView:
    """Return what is seen of an object among unorganised points, as a camera would see it."""
    observation = _sparse(segments, label, camera, floor, scene)
    return ObjectView(observation, segments.labels == label, False, Standing.UNSEEN)


def _sparse(
    segments: Segments, label: int, camera: Camera, floor: float, scene: SceneSettings
) -> Observation:
    """Return what a camera of as many pixels as the points are dense sees of an object."""
    seen = segments.of_object(label)
    sensor = camera_as_dense(seen, camera, scene.intrinsics)
    beside = free_space_of_cloud(segments.points, sensor, floor)
    return Observation(seen, sensor, floor, beside)
