"""Starts the simulated world, perception, skill and RViz; for a full ROS 2 Jazzy.

Then, in another terminal:

    ros2 action send_goal --feedback /open_door kmn_msgs/action/OpenDoor \
        "{handle_angle: -0.7, door_angle: -0.9}"
"""

from __future__ import annotations

from pathlib import Path

from ament_index_python.packages import (
    PackageNotFoundError,
    get_package_prefix,
    get_package_share_directory,
)
from launch import Action, LaunchDescription
from launch.actions import DeclareLaunchArgument, LogInfo, Shutdown
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node, SetParameter

from kmn_perception.ros.launch_arguments import (
    TRUTHS,
    parameter_argument,
    parameter_value,
    warn_of_foreign,
)

# Parameters of sim_node, with a default of its own where there is one.
SIMULATED = {"robot": None, "seed": None, "direction": None, "noise": "kinect"}
RVIZ = "rviz"


def generate_launch_description() -> LaunchDescription:
    """Return the three nodes, and RViz: sim_node tells it of the robot and of all frames."""
    chosen = {name: parameter_value("sim_node", name) for name in SIMULATED}
    world = {"placement": "random", "publish_clock": True, **chosen}
    return LaunchDescription(
        [
            *(parameter_argument("sim_node", *each) for each in SIMULATED.items()),
            DeclareLaunchArgument(
                RVIZ,
                default_value="true",
                choices=TRUTHS,
                description="Show it in RViz, where that is installed.",
            ),
            warn_of_foreign([*SIMULATED, RVIZ]),
            # Simulated time: the simulation may be slower than the system's.
            SetParameter("use_sim_time", True),
            _node("kmn_sim", "sim_node", world),
            _node("kmn_perception", "morph_node"),
            _node("kmn_skill", "skill_node", {"robot": chosen["robot"]}),
            _rviz(IfCondition(LaunchConfiguration(RVIZ))),
        ]
    )


def _node(package: str, executable: str, parameters: dict[str, object] | None = None) -> Node:
    """Return one of the nodes, without which the others are of no use."""
    return Node(
        package=package,
        executable=executable,
        output="screen",
        parameters=[parameters or {}],
        on_exit=Shutdown(reason=f"{executable} ended"),
    )


def _rviz(condition: IfCondition) -> Action:
    try:
        get_package_prefix("rviz2")
    except PackageNotFoundError:
        text = "rviz2 is not installed, nothing is shown; install ros-jazzy-rviz2, or rviz:=false"
        return LogInfo(msg=text, condition=condition)
    view = Path(get_package_share_directory("kmn_skill")) / "rviz/door_demo.rviz"
    return Node(
        package="rviz2",
        executable="rviz2",
        output="screen",
        arguments=["-d", str(view)],
        condition=condition,
    )
