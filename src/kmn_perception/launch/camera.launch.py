"""Starts morph_node on a real camera, whose topics and frames are arguments.

For a full ROS 2 Jazzy:

    ros2 launch kmn_perception camera.launch.py model:=NAME \
        depth_image:=/camera/depth/image_rect_raw camera_info:=/camera/depth/camera_info
"""

from __future__ import annotations

from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

from kmn_perception.ros.launch_arguments import (
    TRUTHS,
    parameter_argument,
    parameter_value,
    warn_of_foreign,
)

NODE = "morph_node"
TOPICS = {
    "depth_image": ("depth/image", "topic of the depth image; its transports lie below it"),
    "camera_info": ("depth/camera_info", "topic of the description of the depth image"),
    "points": ("points", "topic of the organised cloud, instead of a depth image"),
    "image": ("image", "topic of the colour or grey image, for models found by edges too"),
    "image_camera_info": ("image/camera_info", "topic of its description, if it is not registered"),
    "tf": ("/tf", "topic of the transforms"),
    "tf_static": ("/tf_static", "topic of the transforms that never change"),
}
PARAMETERS = (
    "model",
    "weights",
    "objects",
    "world_frame",
    "camera_pose",
    "support_frame",
    "depth_image_transport",
    "image_transport",
    "rectify",
    "calibration",
    "reliability",
)
OTHERS = {
    "namespace": ("", "namespace of the node, and of all topics whose names are relative"),
    "params_file": ("", "path of a ROS parameter file; its values go before those of arguments"),
}
SIM_TIME = "use_sim_time"


def generate_launch_description() -> LaunchDescription:
    """Return the node, as the arguments have it."""
    return LaunchDescription(
        [
            *(
                DeclareLaunchArgument(name, default_value=default, description=text)
                for name, (default, text) in (OTHERS | TOPICS).items()
            ),
            DeclareLaunchArgument(
                SIM_TIME,
                default_value="false",
                choices=TRUTHS,
                description="take the time from /clock, as of a bag that is replayed",
            ),
            *(parameter_argument(NODE, name) for name in PARAMETERS),
            warn_of_foreign([*OTHERS, SIM_TIME, *TOPICS, *PARAMETERS]),
            OpaqueFunction(function=_node),
        ]
    )


def _node(context: LaunchContext) -> list[Node]:
    file = LaunchConfiguration("params_file").perform(context)
    values = {name: parameter_value(NODE, name) for name in PARAMETERS}
    values[SIM_TIME] = LaunchConfiguration(SIM_TIME)
    return [
        Node(
            package="kmn_perception",
            executable=NODE,
            namespace=LaunchConfiguration("namespace"),
            output="screen",
            parameters=[values, file] if file else [values],
            remappings=[(topic, LaunchConfiguration(name)) for name, (topic, _) in TOPICS.items()],
        )
    ]
