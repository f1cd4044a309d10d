"""The pipeline for single objects, given mask, camera pose and handle's side by hand."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray

from kmn_perception.doors.geometry import DOOR
from kmn_perception.estimate import Status
from kmn_perception.evaluation.doors.errors import DoorPlace, door_place
from kmn_perception.evaluation.doors.label import DoorLabel
from kmn_perception.experiments.doors.frames import DoorFrame
from kmn_perception.model.camera import Camera
from kmn_perception.model.room_model import RoomModel
from kmn_perception.pipeline import MorphPipeline
from kmn_perception.scene.camera_pose import CameraPose
from kmn_perception.scene.depth_view import DepthView


def masked_pipeline(
    frame: DoorFrame, pipeline: MorphPipeline, model: RoomModel
) -> DoorPlace | None:
    """Return the door that the pipeline finds in a labelled panel; None unless it is OK.

    The door's model has its handle at the right: frames with one at the left are mirrored.
    """
    label = frame.label
    if label is None:
        return None
    camera = frame.description.camera
    depth = np.where(panel_mask(label, camera), frame.depth, np.float32(np.nan))
    pose = label.camera_pose.copy()
    pose[0, 3] += pipeline.model.camera.position[0]  # the model's doors are about x = 0
    placed = pose
    if label.handle_side == "left":
        depth = np.ascontiguousarray(depth[:, ::-1])
        camera = replace(camera, cx=camera.width - 1.0 - camera.cx)
        placed = np.diag([1.0, -1.0, 1.0, 1.0]) @ pose @ np.diag([-1.0, 1.0, 1.0, 1.0])
    pipeline.settings = replace(pipeline.settings, camera_pose=CameraPose.GIVEN, given_pose=placed)
    estimate = pipeline.estimate(DepthView.of_depth(depth, camera))
    if estimate.status is not Status.OK:
        return None
    values = np.zeros(len(DOOR))
    values[:7] = np.concatenate([estimate.theta, estimate.gamma])
    if label.handle_side == "left":
        values[1:3] *= -1.0
    return door_place(values, label.handle_side or "right", pose, model)


def panel_mask(label: DoorLabel, camera: Camera) -> NDArray[np.bool_]:
    """Return the mask (height, width) of the panel: its polygon, grown to its edges."""
    ends = np.array([end for edge in label.edges if edge for end in (edge.top, edge.bottom)])
    corners = replace(camera, pose=np.eye(4)).project(ends.reshape(-1, 3))[:, :2]
    outline = cv2.convexHull(np.concatenate([corners, label.panel]).astype(np.float32))
    mask = np.zeros((camera.height, camera.width), np.uint8)
    cv2.fillConvexPoly(mask, np.rint(outline).astype(np.int32), 1)
    return mask > 0
