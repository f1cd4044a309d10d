"""Starts the simulated world, perception, skill and RViz; for a full ROS 2 Jazzy.

Then, in another terminal:

    ros2 action send_goal --feedback /open_door kmn_msgs/action/OpenDoor \
        "{handle_angle: -0.7, door_angle: -0.9}"
"""

from __future__ import annotations

from pathlib import Path

from ament_index_python.packages import get_package_prefix, get_package_share_directory
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.conditions import IfCondition
from launch.substitutions import Command, LaunchConfiguration
from launch_ros.actions import Node, SetParameter
from launch_ros.parameter_descriptions import ParameterValue

from kmn_perception.model.camera import Camera
from kmn_perception.model.rotation import quaternion_from_matrix

ARGUMENTS = {
    "seed": ("0", "seed of the random door and of the noise"),
    "direction": ("pull", "how the door opens: pull or push"),
    "noise": ("kinect", "what the sensor adds to the exact depth: none or kinect"),
    "rviz": ("true", "show it in RViz"),
}


def generate_launch_description() -> LaunchDescription:
    """Return the three nodes, with what RViz needs to show them."""
    chosen = {name: LaunchConfiguration(name) for name in ("seed", "direction", "noise")}
    view = Path(get_package_share_directory("kmn_skill")) / "rviz/door_demo.rviz"
    describe = Path(get_package_prefix("kmn_sim")) / "lib/kmn_sim/robot_description"
    robot = ParameterValue(Command([str(describe)]), value_type=str)
    return LaunchDescription(
        [
            *(
                DeclareLaunchArgument(name, default_value=default, description=text)
                for name, (default, text) in ARGUMENTS.items()
            ),
            # Simulated time: the simulation may be slower than the system's.
            SetParameter("use_sim_time", True),
            _node(
                "kmn_sim",
                "sim_node",
                parameters=[{"placement": "random", "publish_clock": True, **chosen}],
            ),
            _node("kmn_perception", "morph_node"),
            _node("kmn_skill", "skill_node"),
            _node("tf2_ros", "static_transform_publisher", arguments=_camera_transform()),
            _node(
                "robot_state_publisher",
                "robot_state_publisher",
                parameters=[{"robot_description": robot}],
            ),
            _node(
                "rviz2",
                "rviz2",
                arguments=["-d", str(view)],
                condition=IfCondition(LaunchConfiguration("rviz")),
            ),
        ]
    )


def _node(package: str, executable: str, **options: object) -> Node:
    return Node(package=package, executable=executable, output="screen", **options)


def _camera_transform() -> list[str]:
    """Return where the door's canonical camera is in the world."""
    pose = Camera.load("door").pose
    place = zip(("--x", "--y", "--z"), pose[:3, 3], strict=True)
    turned = zip(
        ("--qx", "--qy", "--qz", "--qw"), quaternion_from_matrix(pose[:3, :3]), strict=True
    )
    numbers = [text for name, value in (*place, *turned) for text in (name, str(value))]
    return [*numbers, "--frame-id", "world", "--child-frame-id", "camera_optical_frame"]
