"""Conversions between ROS messages and what the method works with; the one place where they meet.

`reading` is the edge where frames come in, `writing` makes what a camera publishes, and `results`
what morph_node publishes.
"""

from kmn_perception.ros.messages.errors import MessageError
from kmn_perception.ros.messages.reading import (
    camera_from_info,
    depth_from_image,
    points_from_cloud,
    view_from_cloud,
    view_from_image,
)
from kmn_perception.ros.messages.results import (
    body_marker,
    markers_from_estimates,
    parameters_from_estimate,
)
from kmn_perception.ros.messages.transforms import transform_message
from kmn_perception.ros.messages.writing import (
    cloud_from_points,
    image_from_depth,
    info_from_camera,
)

__all__ = [
    "MessageError",
    "camera_from_info",
    "cloud_from_points",
    "body_marker",
    "depth_from_image",
    "image_from_depth",
    "info_from_camera",
    "markers_from_estimates",
    "parameters_from_estimate",
    "points_from_cloud",
    "transform_message",
    "view_from_cloud",
    "view_from_image",
]
