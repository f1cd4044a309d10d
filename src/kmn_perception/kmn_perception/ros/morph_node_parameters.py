"""The ROS parameters of morph_node, which ``config/nodes/morph_node_parameters.yaml`` states."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kmn_perception.configuration.node_parameters import ParameterError, pick
from kmn_perception.estimator import EstimatorSettings
from kmn_perception.model.rotation import matrix_from_quaternion
from kmn_perception.pipeline_interface import CalibrationState, FrameBudget, PipelineSettings
from kmn_perception.scene.camera_pose import CameraPose
from kmn_perception.scene.segmentation import SegmentationSettings
from kmn_perception.scene.settings import SceneSettings
from kmn_perception.scene.support_plane import SupportPlaneSettings


@dataclass(frozen=True, eq=False)
class MorphNodeSettings:
    """All parameters of morph_node, checked.

    Attributes
    ----------
    model, weights
        As for `MorphEstimator.load`; of several models, separated by commas.
    world_frame
        Frame of the parameters; clouds in it need no camera pose.
    support_frame
        Frame of the parameters where the camera's pose is that above the support plane.
    transform_delay
        How long a frame waits for its transforms, seconds.
    reliability
        Of the subscriptions to the camera, ``best_available``, ``best_effort`` or ``reliable``.
    depth_image_transport, image_transport
        How depth images and the images beside them come, ``raw`` or compressed.
    objects
        Which ones are estimated, ``nearest`` or ``all``.
    object_distance
        By which an object's centre may move between two frames, metres.
    description_change
        By which an object may differ from the one that was described, metres.
    max_range
        Coordinates beyond it are not measurements, metres.
    rectify
        Rectify depth and grey images whose description has a distortion.
    use_image
        Use the images beside the depth, where the model is found by them too.
    image_delay
        By which an image's stamp may differ from that of the depth, seconds.
    fused_frames
        How many frames of a door are fused at most; 1: each frame is measured by itself.
    estimator, pipeline
        Settings of the two.
    """

    model: str
    weights: str
    world_frame: str
    support_frame: str
    transform_delay: float
    reliability: str
    depth_image_transport: str
    image_transport: str
    objects: str
    object_distance: float
    description_change: float
    max_range: float
    rectify: bool
    use_image: bool
    image_delay: float
    fused_frames: int
    estimator: EstimatorSettings
    pipeline: PipelineSettings

    @property
    def frame(self) -> str:
        """Frame of what is estimated of a frame that is not in the world frame."""
        above_plane = self.pipeline.camera_pose is CameraPose.SUPPORT_PLANE
        return self.support_frame if above_plane else self.world_frame

    @classmethod
    def check(cls, values: Mapping[str, Any]) -> MorphNodeSettings:
        """Check the values of the parameters, by name, together; each one is valid by itself.

        Raises
        ------
        ParameterError
            If one is wrong.
        """
        if not all(np.less(values["crop_min"], values["crop_max"])):
            raise ParameterError(
                f"'crop_min' must be below 'crop_max' along each axis, found "
                f"{list(values['crop_min'])} and {list(values['crop_max'])}"
            )
        if values["support_frame"] == values["world_frame"]:
            raise ParameterError(
                f"'support_frame' must differ from 'world_frame', found '{values['world_frame']}'"
            )
        scene = SceneSettings.load()
        return cls(
            model=values["model"],
            weights=values["weights"],
            world_frame=values["world_frame"],
            support_frame=values["support_frame"],
            transform_delay=values["transform_delay"],
            reliability=values["reliability"],
            depth_image_transport=values["depth_image_transport"],
            image_transport=values["image_transport"],
            objects=values["objects"],
            object_distance=values["object_distance"],
            description_change=values["description_change"],
            max_range=values["max_range"],
            rectify=values["rectify"],
            use_image=values["use_image"],
            image_delay=values["image_delay"],
            fused_frames=values["fused_frames"],
            estimator=pick(EstimatorSettings, values),
            pipeline=PipelineSettings(
                camera_pose=CameraPose(values["camera_pose"]),
                given_pose=_pose(values["camera_position"], values["camera_quaternion"]),
                plane=SupportPlaneSettings(
                    values["plane_distance"],
                    values["plane_max_tilt"],
                    values["plane_min_fraction"],
                    scene.raised_plane,
                ),
                background=pick(SegmentationSettings, values),
                scene=scene,
                calibration=CalibrationState(values["calibration"]),
                budget=FrameBudget(values["max_objects"], values["max_time"]),
            ),
        )


def _pose(position: Any, quaternion: Any) -> NDArray[np.float64]:
    """Return the pose (4, 4) of a position in metres and a quaternion (x, y, z, w)."""
    if abs(np.linalg.norm(quaternion) - 1.0) > 0.01:
        raise ParameterError(f"'camera_quaternion' must be of length 1, found {list(quaternion)}")
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = matrix_from_quaternion(quaternion), position
    return pose
