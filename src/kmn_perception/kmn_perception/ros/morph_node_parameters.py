"""The ROS parameters of morph_node; their defaults are in ``config/nodes/morph_node.yaml``."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rcl_interfaces.msg import ParameterDescriptor

from kmn_perception.estimator import EstimatorSettings
from kmn_perception.model.rotation import matrix_from_quaternion
from kmn_perception.pipeline import PipelineSettings
from kmn_perception.ros.parameters import (
    ParameterError,
    anything,
    check_choice,
    choice,
    pick,
    real,
    whole,
)
from kmn_perception.scene.camera_pose import CameraPose
from kmn_perception.scene.segmentation import SegmentationSettings
from kmn_perception.scene.settings import SceneSettings
from kmn_perception.scene.support_plane import SupportPlaneSettings

RELIABILITIES = ("best_effort", "reliable")
OBJECTS = ("nearest", "all")
CAMERA_POSES = tuple(pose.value for pose in CameraPose)
LENGTHS = {"camera_position": 3, "camera_quaternion": 4, "crop_min": 3, "crop_max": 3}


@dataclass(frozen=True, eq=False)
class MorphNodeSettings:
    """All parameters of morph_node, checked.

    Attributes
    ----------
    model, weights
        As for `MorphEstimator.load`.
    world_frame
        Frame of the parameters; clouds in it need no camera pose.
    reliability
        Of the subscriptions, ``best_effort`` or ``reliable``.
    objects
        Which ones are estimated, ``nearest`` or ``all``.
    object_distance
        By which an object's centre may move between two frames, metres.
    max_range
        Coordinates beyond it are not measurements, metres.
    rectify
        Rectify depth images whose description has a distortion.
    estimator, pipeline
        Settings of the two.
    """

    model: str
    weights: str
    world_frame: str
    reliability: str
    objects: str
    object_distance: float
    max_range: float
    rectify: bool
    estimator: EstimatorSettings
    pipeline: PipelineSettings

    @classmethod
    def check(cls, values: Mapping[str, Any]) -> MorphNodeSettings:
        """Check the parameters' values, by name, one by one and together.

        Raises
        ------
        ParameterError
            If one is wrong.
        """
        for name, length in LENGTHS.items():
            if len(values[name]) != length or not np.isfinite(values[name]).all():
                raise ParameterError(
                    f"'{name}' must be {length} finite numbers, found {list(values[name])}"
                )
        check_choice("reliability", values["reliability"], RELIABILITIES)
        check_choice("objects", values["objects"], OBJECTS)
        check_choice("camera_pose", values["camera_pose"], CAMERA_POSES)
        for name in ("model", "world_frame"):
            if not values[name]:
                raise ParameterError(f"'{name}' is empty")
        if not all(np.less(values["crop_min"], values["crop_max"])):
            raise ParameterError(
                f"'crop_min' must be below 'crop_max' along each axis, found "
                f"{list(values['crop_min'])} and {list(values['crop_max'])}"
            )
        return cls(
            model=values["model"],
            weights=values["weights"],
            world_frame=values["world_frame"],
            reliability=values["reliability"],
            objects=values["objects"],
            object_distance=values["object_distance"],
            max_range=values["max_range"],
            rectify=values["rectify"],
            estimator=pick(EstimatorSettings, values),
            pipeline=PipelineSettings(
                camera_pose=CameraPose(values["camera_pose"]),
                given_pose=_pose(values["camera_position"], values["camera_quaternion"]),
                plane=pick(SupportPlaneSettings, values, "plane_"),
                background=pick(SegmentationSettings, values),
                scene=SceneSettings.load(),
            ),
        )


def _pose(position: Any, quaternion: Any) -> NDArray[np.float64]:
    """Return the pose (4, 4) of a position in metres and a quaternion (x, y, z, w)."""
    if abs(np.linalg.norm(quaternion) - 1.0) > 0.01:
        raise ParameterError(f"'camera_quaternion' must be of length 1, found {list(quaternion)}")
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = matrix_from_quaternion(quaternion), position
    return pose


DESCRIPTORS: dict[str, ParameterDescriptor] = {
    "model": anything("Kinematic model: a shipped name or the path of a YAML file."),
    "weights": anything("Path of a .safetensors file; empty: the weights shipped with the model."),
    "world_frame": anything("Frame of the parameters; clouds in this frame need no camera pose."),
    "reliability": choice(
        "Reliability of the subscriptions (REP-2003).", RELIABILITIES, read_only=True
    ),
    "objects": choice("Which objects of a frame are estimated.", OBJECTS),
    "object_distance": real(
        "Of all objects, one keeps its id while its centre moves less between two frames [m].",
        0.0,
        10.0,
    ),
    "camera_pose": choice("Where the camera's optical frame is in the world.", CAMERA_POSES),
    "camera_position": anything("Given position x, y, z of the optical frame [m].", "3 numbers"),
    "camera_quaternion": anything(
        "Given orientation x, y, z, w of the optical frame.", "4 numbers, length 1"
    ),
    "plane_distance": real("Points so near to the support plane lie on it [m].", 0.001, 0.1),
    "plane_max_tilt": real(
        "Largest angle of its normal to the image's up direction [rad].", 0.0, 1.5
    ),
    "plane_min_fraction": real("Least part of the points that lies on it.", 0.01, 1.0),
    "max_range": real("Coordinates beyond it are not measurements [m].", 0.1, 1e6),
    "rectify": anything(
        "Rectify depth images whose camera_info has a distortion; false: they are rectified."
    ),
    "crop": anything("Keep only what lies in the crop volume."),
    "crop_min": anything("Lower corner of the crop volume, world frame [m].", "3 numbers"),
    "crop_max": anything("Upper corner of the crop volume, world frame [m].", "3 numbers"),
    "remove_plane": anything("Remove the support plane z = 0 and what lies below it."),
    "plane_margin": real("Height above z = 0 that belongs to the support plane [m].", 0.0, 0.5),
    "cluster": anything("Part the points into clusters; large ones are objects."),
    "cluster_step": real("Larger steps between neighbours part clusters [m].", 0.001, 1.0),
    "cluster_min_points": whole("Smaller clusters are not objects.", 1, 1_000_000),
    "cluster_concave_angle": real(
        "Sharper concave edges of a surface part clusters; 0: none do [rad].", 0.0, 3.0
    ),
    "iterations": whole("Largest number N of predictions (Algorithm 1).", 1, 100),
    "tolerance": real(
        "Without refinement: converged when the last step changed theta by less [m, rad, 1].",
        0.0,
        1.0,
    ),
    "min_points": whole("Objects of fewer points are not estimated.", 1, 1_000_000),
    "max_residual": real("Largest median distance of the points to the model [m].", 0.0, 10.0),
    "max_deviation": real("Largest distance of most points to the model [m].", 0.0, 10.0),
    "deviation_share": real("Share of the points that must lie within max_deviation.", 0.5, 1.0),
    "limit_margin": real("Part of its range by which a parameter may exceed its limits.", 0.0, 1.0),
    "refine": anything("Fit the model to the observation after the predictions."),
}
