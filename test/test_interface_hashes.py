"""The interfaces that the wheels lack, against the type hashes (REP-2011) of a full Jazzy's.

The values were published by others who built the real packages. On a full Jazzy each can be seen in
/opt/ros/jazzy/share/PACKAGE/{msg,action}/NAME.json (`type_hashes`), and with
`ros2 topic info --verbose TOPIC` of any topic of the type.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from ament_index_python.packages import get_package_share_directory
from control_msgs.action import FollowJointTrajectory, GripperCommand
from rclpy.action.server import ActionServer
from rclpy.node import Node
from tf2_msgs.msg import TFMessage
from vision_msgs.msg import Detection3DArray

JAZZY = {
    "control_msgs/action/FollowJointTrajectory": (
        "738ebcb7a2d7cfa42f9f1001cc99ce3a4383d1cfe508015d9be8485e4b1c66f6"
    ),
    "control_msgs/action/FollowJointTrajectory_FeedbackMessage": (
        "80398fcb9674a79081a9906e2ccf0c804dd7cb15e22e362e606ee87186beab71"
    ),
    "control_msgs/action/FollowJointTrajectory_GetResult": (
        "e3ceb38e3e1867c8dc0f46014df26e90eb93422f27e9e97f936e07f94be4bc8b"
    ),
    "control_msgs/action/FollowJointTrajectory_SendGoal": (
        "b13789dddc325a7a962825c45e28c77d37237ec129dd0c34dc5994562938c57f"
    ),
    "control_msgs/action/GripperCommand": (
        "e17c0e644eccf14bea84a0a93e0977182872c2eb7873ca6694900059b46dbc84"
    ),
    "control_msgs/action/GripperCommand_FeedbackMessage": (
        "392ff03fcd872f9dc2405cbeb2897fcf011ad9998458b6aa85c603b8a49e431d"
    ),
    "control_msgs/msg/GripperCommand": (
        "57eb8f326c9889ca8bb34ead82cc94cc09bf6bc5c3b6c09546dca3a00b589890"
    ),
    "control_msgs/msg/JointComponentTolerance": (
        "739ea7566931944d33830fa10f1bf5e7a7fbdc3172bce7a7eaac642bd6e3ffa4"
    ),
    "control_msgs/msg/JointTolerance": (
        "c254f9cece0f3b733017b6990fd46d1326e25242d6b8844398c97d9a88e7d648"
    ),
    "tf2_msgs/msg/TFMessage": ("e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087"),
    "vision_msgs/msg/BoundingBox3D": (
        "bbb73a65c163d7f9bb29009c7bde9f7faa576bd2d23299c4511d19230dab4698"
    ),
    "vision_msgs/msg/Detection3D": (
        "ddd703be132ab0b69d33121f1bb034132bfbb3b0ac5f9fb1516005ba1c8a265b"
    ),
    "vision_msgs/msg/Detection3DArray": (
        "793f5eab9595ac1c0da07873cc859db42eae51f0ee76056db8562515d830e018"
    ),
    "vision_msgs/msg/ObjectHypothesis": (
        "51da43cec11c01957a64d1e05a24acd18aae7745ec30b74348ad5f6d634f7f90"
    ),
    "vision_msgs/msg/ObjectHypothesisWithPose": (
        "41c12344c0396c48b81df12467c192d99b2a0eb1463c5c37194e4223251c80bc"
    ),
}


@pytest.mark.parametrize("name", JAZZY)
def test_the_hash_is_that_of_a_full_jazzy(name: str) -> None:
    package, folder, interface = name.split("/")
    file = f"{folder}/{interface.split('_')[0]}.json"
    described = json.loads(Path(get_package_share_directory(package), file).read_text())
    hashes = {entry["type_name"]: entry["hash_string"] for entry in described["type_hashes"]}
    assert hashes[name] == f"RIHS01_{JAZZY[name]}"


def test_other_nodes_are_told_the_hashes(graph: Any) -> None:
    """What Fast DDS announces, by which a full Jazzy tells whether the types agree."""
    node = Node("announcer", context=graph.context)
    node.create_publisher(TFMessage, "transforms", 1)
    node.create_publisher(Detection3DArray, "detections", 1)
    ActionServer(node, FollowJointTrajectory, "follow", lambda goal: None)
    ActionServer(node, GripperCommand, "grip", lambda goal: None)
    topics = {
        "transforms": "tf2_msgs/msg/TFMessage",
        "detections": "vision_msgs/msg/Detection3DArray",
        "follow/_action/feedback": "control_msgs/action/FollowJointTrajectory_FeedbackMessage",
        "grip/_action/feedback": "control_msgs/action/GripperCommand_FeedbackMessage",
    }
    for topic, name in topics.items():
        (publisher,) = graph.wait_for(lambda topic=topic: node.get_publishers_info_by_topic(topic))
        assert publisher.topic_type == name
        assert str(publisher.topic_type_hash) == f"RIHS01_{JAZZY[name]}"
    node.destroy_node()
