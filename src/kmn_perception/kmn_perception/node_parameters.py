"""The ROS parameters of morph_node; their defaults are in ``config/nodes/morph_node.yaml``."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray
from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.node import Node

from kmn_perception import resources
from kmn_perception.configuration import Section
from kmn_perception.estimator import EstimatorSettings
from kmn_perception.pipeline import CameraPose, PipelineSettings
from kmn_perception.rotation import matrix_from_quaternion
from kmn_perception.segmentation import SegmentationSettings
from kmn_perception.support_plane import SupportPlaneSettings

RELIABILITIES = ("best_effort", "reliable")
OBJECTS = ("nearest", "all")
CAMERA_POSES = tuple(pose.value for pose in CameraPose)
LENGTHS = {"camera_position": 3, "camera_quaternion": 4, "crop_min": 3, "crop_max": 3}

Settings = TypeVar("Settings")


class ParameterError(ValueError):
    """Parameters that are wrong; the text names them and what was expected."""


@dataclass(frozen=True, eq=False)
class NodeSettings:
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
    estimator: EstimatorSettings
    pipeline: PipelineSettings

    @classmethod
    def check(cls, values: Mapping[str, Any]) -> NodeSettings:
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
        _check_choice("reliability", values["reliability"], RELIABILITIES)
        _check_choice("objects", values["objects"], OBJECTS)
        _check_choice("camera_pose", values["camera_pose"], CAMERA_POSES)
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
            estimator=_pick(EstimatorSettings, values),
            pipeline=PipelineSettings(
                camera_pose=CameraPose(values["camera_pose"]),
                given_pose=_pose(values["camera_position"], values["camera_quaternion"]),
                plane=_pick(SupportPlaneSettings, values, "plane_"),
                background=_pick(SegmentationSettings, values),
            ),
        )


def declare_parameters(node: Node) -> None:
    """Declare all parameters with the defaults of the configuration file.

    Raises
    ------
    ParameterException
        If the user's value of a parameter is of another type or out of its range.
    """
    file = Section.load(resources.find("config/nodes", "morph_node"))
    defaults = file.section("/**").section("ros__parameters")
    defaults.allow(DESCRIPTORS)
    node.declare_parameters(
        "", [(name, defaults.values[name], DESCRIPTORS[name]) for name in DESCRIPTORS]
    )


def read_parameters(node: Node) -> dict[str, Any]:
    """Return the parameters' present values by name."""
    return {name: node.get_parameter(name).value for name in DESCRIPTORS}


def _check_choice(name: str, value: str, choices: tuple[str, ...]) -> None:
    if value not in choices:
        raise ParameterError(f"'{name}' must be one of {', '.join(choices)}, found '{value}'")


def _pose(position: Any, quaternion: Any) -> NDArray[np.float64]:
    """Return the pose (4, 4) of a position in metres and a quaternion (x, y, z, w)."""
    if abs(np.linalg.norm(quaternion) - 1.0) > 0.01:
        raise ParameterError(f"'camera_quaternion' must be of length 1, found {list(quaternion)}")
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = matrix_from_quaternion(quaternion), position
    return pose


def _pick(kind: type[Settings], values: Mapping[str, Any], prefix: str = "") -> Settings:
    """Make settings of the parameters that are named as their fields."""
    names = [field.name for field in fields(kind)]  # type: ignore[arg-type]
    picked = {name: values[prefix + name] for name in names}
    return kind(**{name: tuple(v) if name in LENGTHS else v for name, v in picked.items()})


def _any(description: str, constraints: str = "", read_only: bool = False) -> ParameterDescriptor:
    return ParameterDescriptor(
        description=description, additional_constraints=constraints, read_only=read_only
    )


def _real(description: str, low: float, high: float) -> ParameterDescriptor:
    limits = FloatingPointRange(from_value=low, to_value=high)
    return ParameterDescriptor(description=description, floating_point_range=[limits])


def _whole(description: str, low: int, high: int) -> ParameterDescriptor:
    limits = IntegerRange(from_value=low, to_value=high, step=1)
    return ParameterDescriptor(description=description, integer_range=[limits])


DESCRIPTORS: dict[str, ParameterDescriptor] = {
    "model": _any("Kinematic model: a shipped name or the path of a YAML file."),
    "weights": _any("Path of a .safetensors file; empty: the weights shipped with the model."),
    "world_frame": _any("Frame of the parameters; clouds in this frame need no camera pose."),
    "reliability": _any(
        "Reliability of the subscriptions (REP-2003).", " or ".join(RELIABILITIES), read_only=True
    ),
    "objects": _any("Which objects of a frame are estimated.", " or ".join(OBJECTS)),
    "object_distance": _real(
        "Of all objects, one keeps its id while its centre moves less between two frames [m].",
        0.0,
        10.0,
    ),
    "camera_pose": _any(
        "Where the camera's optical frame is in the world.", " or ".join(CAMERA_POSES)
    ),
    "camera_position": _any("Given position x, y, z of the optical frame [m].", "3 numbers"),
    "camera_quaternion": _any(
        "Given orientation x, y, z, w of the optical frame.", "4 numbers, length 1"
    ),
    "plane_distance": _real("Points so near to the support plane lie on it [m].", 0.001, 0.1),
    "plane_max_tilt": _real(
        "Largest angle of its normal to the image's up direction [rad].", 0.0, 1.5
    ),
    "plane_min_fraction": _real("Least part of the points that lies on it.", 0.01, 1.0),
    "max_range": _real("Coordinates beyond it are not measurements [m].", 0.1, 1e6),
    "crop": _any("Keep only what lies in the crop volume."),
    "crop_min": _any("Lower corner of the crop volume, world frame [m].", "3 numbers"),
    "crop_max": _any("Upper corner of the crop volume, world frame [m].", "3 numbers"),
    "remove_plane": _any("Remove the support plane z = 0 and what lies below it."),
    "plane_margin": _real("Height above z = 0 that belongs to the support plane [m].", 0.0, 0.5),
    "cluster": _any("Part the points into clusters; large ones are objects."),
    "cluster_step": _real("Larger steps between neighbours part clusters [m].", 0.001, 1.0),
    "cluster_min_points": _whole("Smaller clusters are not objects.", 1, 1_000_000),
    "cluster_crease": _real(
        "Sharper concave creases of a surface part clusters; 0: none do [rad].", 0.0, 3.0
    ),
    "iterations": _whole("Largest number N of predictions (Algorithm 1).", 1, 100),
    "tolerance": _real(
        "Without refinement: converged when the last step changed theta by less [m, rad, 1].",
        0.0,
        1.0,
    ),
    "min_points": _whole("Objects of fewer points are not estimated.", 1, 1_000_000),
    "max_residual": _real("Largest median distance of the points to the model [m].", 0.0, 10.0),
    "max_deviation": _real(
        "Largest distance of nine tenths of the points to the model [m].", 0.0, 10.0
    ),
    "limit_margin": _real(
        "Part of its range by which a parameter may exceed its limits.", 0.0, 1.0
    ),
    "refine": _any("Fit the model to the observation after the predictions."),
}
