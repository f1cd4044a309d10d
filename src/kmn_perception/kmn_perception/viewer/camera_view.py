"""What the camera sees: the cloud, where the camera is, and its picture with the model drawn in."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import cv2
import numpy as np
import viser
from numpy.typing import NDArray
from rclpy.node import Node
from sensor_msgs.msg import CameraInfo, PointCloud2

from kmn_perception.model.camera import Camera
from kmn_perception.model.transformation import transform_points
from kmn_perception.ros.image_transport import transported
from kmn_perception.ros.messages import MessageError, view_from_cloud, view_from_image
from kmn_perception.ros.messages.compressed import raw_depth, raw_image
from kmn_perception.ros.messages.grey import colour_from_image
from kmn_perception.scene.depth_view import DepthView
from kmn_perception.scene.settings import SceneSettings
from kmn_perception.viewer.drawing import colour, wxyz
from kmn_perception.viewer.inputs import Inputs, NewestOnly
from kmn_perception.viewer.objects_view import Perceived
from kmn_perception.viewer.shapes import corners
from kmn_perception.viewer.viewer_parameters import ViewerSettings
from kmn_perception.visualization.overlay import ACCEPTED, REFUSED, Bodies, wireframe

INFO, POINTS = "depth/camera_info", "points"
FRUSTUM = 0.25  # metres
NEAR, FAR = (255, 240, 214), (70, 84, 110)  # colours of depths
LINE = 2  # pixels
PLACEHOLDER = np.full((48, 64, 3), 32, np.uint8)


class CameraInput:
    """Listens to depth image, cloud and colour image, as long as somebody looks on.

    Of depth image and cloud only one is taken, the image where there is one: it is smaller.
    """

    def __init__(self, node: Node, inputs: Inputs, settings: ViewerSettings) -> None:
        self._node, self._settings = node, settings
        self._topics = NewestOnly(node, inputs)
        self._depth = transported(node, "depth/image", settings.depth_image_transport)
        self._image = transported(node, "image", settings.image_transport)
        self._info: CameraInfo | None = None
        self._colours: NDArray[np.uint8] | None = None

    def listen(self, wanted: bool) -> None:
        """Subscribe, or no longer."""
        (kind, depth), (image_kind, image) = self._depth, self._image
        has_image = self._node.count_publishers(depth) > 0
        has_cloud = self._node.count_publishers(self._node.resolve_topic_name(POINTS)) > 0
        self._topics.listen(depth, kind, wanted and (has_image or not has_cloud))
        self._topics.listen(INFO, CameraInfo, wanted and (has_image or not has_cloud))
        self._topics.listen(image, image_kind, wanted)
        self._topics.listen(POINTS, PointCloud2, wanted and has_cloud and not has_image)

    def take(self) -> tuple[DepthView, NDArray[np.uint8] | None] | None:
        """Take what was seen last, with its colours (height, width, 3), if anything new came.

        Raises
        ------
        MessageError
            If it cannot be read.
        """
        image = self._topics.take(self._image[1])
        if image is not None:
            self._colours = colour_from_image(raw_image(image))
        self._info = self._topics.take(INFO) or self._info
        depth, cloud = self._topics.take(self._depth[1]), self._topics.take(POINTS)
        reach = self._settings.drawing.max_range
        if depth is not None:
            if self._info is None:
                raise MessageError("no_camera_info", f"depth/image came without {INFO}")
            return view_from_image(raw_depth(depth), self._info, reach), self._colours
        if cloud is not None:
            return view_from_cloud(cloud, reach, self._settings.world_frame), self._colours
        return None


class CameraView:
    """Draws it.

    Parameters
    ----------
    find_pose
        Returns the pose (4, 4) of a frame in the world at a stamp (ns).
    """

    def __init__(
        self,
        server: viser.ViserServer,
        settings: ViewerSettings,
        find_pose: Callable[[str, int], NDArray[np.float64]],
    ) -> None:
        self._scene, self._settings, self._find_pose = server.scene, settings.drawing, find_pose
        self._picture = server.gui.add_image(PLACEHOLDER, label="camera", format="jpeg")
        self._intrinsics = SceneSettings.load().intrinsics

    def draw(
        self, view: DepthView, colours: NDArray[np.uint8] | None, objects: Sequence[Perceived]
    ) -> None:
        """Draw what was seen, and the objects into the picture.

        Raises
        ------
        TransformError
            If nobody tells where the camera is.
        """
        pose = np.eye(4) if view.in_world else self._find_pose(view.frame, view.stamp)
        placed = view.placed(pose, self._intrinsics) if not view.in_world else view
        if colours is not None and colours.shape[:2] != view.points.shape[:2]:
            colours = None  # of another camera
        self._draw_cloud(view.points, colours, pose)
        if placed.camera is None:
            return
        camera, depth = placed.camera, placed.depth()
        self._scene.add_camera_frustum(
            "/camera",
            fov=2.0 * math.atan(camera.height / (2.0 * camera.fy)),
            aspect=camera.width / camera.height,
            scale=FRUSTUM,
            color=colour(ACCEPTED),
            wxyz=wxyz(camera.pose[:3, :3]),
            position=camera.position,
        )
        self._picture.image = picture(depth, camera, colours, objects)

    def _draw_cloud(
        self,
        points: NDArray[np.float32],
        colours: NDArray[np.uint8] | None,
        pose: NDArray[np.float64],
    ) -> None:
        measured = np.isfinite(points).all(axis=-1)
        step = max(1, math.ceil(measured.sum() / self._settings.max_points))
        chosen = np.flatnonzero(measured)[::step]
        flat = points.reshape(-1, 3)[chosen]
        if colours is None:
            painted = depth_colours(np.linalg.norm(flat, axis=1))
        else:
            painted = colours.reshape(-1, 3)[chosen]
        self._scene.add_point_cloud(
            "/cloud",
            transform_points(pose, flat),
            painted,
            point_size=self._settings.point_size,
            point_shape="square",
            point_shading="flat",
        )


def depth_colours(depth: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Return colours (..., 3) of depths (...), from near to far; black where it is NaN."""
    measured = depth[np.isfinite(depth)]
    low, high = np.percentile(measured, [2, 98]) if measured.size else (0.0, 1.0)
    share = np.clip((depth - low) / max(high - low, 1e-6), 0.0, 1.0)[..., None]
    mixed = np.array(NEAR) * (1.0 - share) + np.array(FAR) * share
    return np.nan_to_num(mixed).astype(np.uint8)


def picture(
    depth: NDArray[np.float32],
    camera: Camera,
    colours: NDArray[np.uint8] | None,
    objects: Sequence[Perceived],
) -> NDArray[np.uint8]:
    """Return the colour image, or else the depth (height, width), with edges of the objects."""
    shown = depth_colours(depth) if colours is None else colours.copy()
    front = [each for each in objects if _in_front(each, camera)]
    everything = Bodies.together(Bodies(each.cubes, each.axes) for each in front)
    for each in front:
        visible, _ = wireframe(Bodies(each.cubes, each.axes), camera, everything)
        paint = colour(ACCEPTED if each.holds else REFUSED)
        lines = np.clip(visible, -1e4, 1e4).round().astype(np.int32)
        cv2.polylines(shown, list(lines), False, paint, LINE, cv2.LINE_AA)
    return shown


def _in_front(found: Perceived, camera: Camera) -> bool:
    """Tell whether all of an object is before the camera, whose projection can be drawn."""
    return bool(len(found.cubes)) and bool(
        (camera.project(corners(found.cubes))[..., 2] > camera.near).all()
    )
