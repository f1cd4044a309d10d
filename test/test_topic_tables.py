"""The documents' tables of topics, services and frames, against what the nodes really have."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile
from tf2_msgs.msg import TFMessage

from kmn_perception.ros.morph_node import MorphNode

pytest.importorskip("pybullet")
pytest.importorskip("robotic")
pytest.importorskip("viser")
from kmn_perception.viewer.viewer_node import Viewer  # noqa: E402
from kmn_sim.ros.sim_node import SimNode  # noqa: E402
from kmn_skill.planning.robot import RobotModel  # noqa: E402
from kmn_skill.ros.skill_node import SkillNode  # noqa: E402

ROOT = Path(__file__).parents[1]
CONTROLLERS = RobotModel.load("pr2").controllers  # with control:=action
SEND_GOAL = "/_action/send_goal"
OF_ALL_NODES = re.compile(
    r"/rosout|/parameter_events|/(\w+_node|viewer)/\w+(_parameters(_atomically)?|_types|_description)"
)
NODES: dict[str, tuple[type[Node], str, dict[str, Any]]] = {  # with all that they may have
    "docs/morph_node.md": (MorphNode, "morph_node", {"model": "room_door"}),
    "docs/simulation.md": (SimNode, "sim_node", {"publish_clock": True, "image": True}),
    "docs/skill.md": (SkillNode, "skill_node", {"door_angles": "door_state", "model": "drawer"}),
    "docs/viewer.md": (Viewer, "viewer", {"port": 0}),
}
NOT_AT_ONCE = {  # subscribed when they are needed, or served by another node
    "docs/morph_node.md": {
        *("tf", "open_door", "operate_joint"),
        *("depth/image/compressedDepth", "image/compressed"),
    },
    "docs/simulation.md": {"cmd_vel"},  # of a base that takes velocities
    "docs/skill.md": {
        *("tf", "tf_static", "odom", "cmd_vel"),
        *(each.name for each in CONTROLLERS.values()),
    },
    "docs/viewer.md": {
        *("depth/image", "depth/camera_info", "points", "image", "tf"),
        *("operate_joint", "reset"),  # which the buttons use
    },
}


def table(page: str) -> dict[str, str]:
    """Return the types, as package/Name, of the names in a page's table of topics."""
    text = (ROOT / page).read_text(encoding="utf-8")
    found: dict[str, str] = {}
    for cells in re.findall(r"^\| (`[^|]*?`) \| (`\w+_\w+/[^|]*?`) \|", text, flags=re.MULTILINE):
        names, types = (re.findall(r"`([^`]+)`", cell) for cell in cells)
        whole: list[str] = []
        for kind in types:
            package = kind.split("/")[0] if "/" in kind else whole[-1].split("/")[0]
            whole.append(f"{package}/{kind.split('/')[-1]}")
        whole *= 1 if len(whole) == len(names) else len(names)
        found |= {name.lstrip("/"): kind for name, kind in zip(names, whole, strict=True)}
    return found


def interfaces(node: Node, name: str) -> dict[str, str]:
    """Return the types, as package/Name, of a node's topics, services and actions."""
    listed = [
        *node.get_publisher_names_and_types_by_node(name, "/"),
        *node.get_subscriber_names_and_types_by_node(name, "/"),
        *node.get_service_names_and_types_by_node(name, "/"),
    ]
    return {
        topic.lstrip("/").removesuffix(SEND_GOAL): (
            f"{types[0].split('/')[0]}/{types[0].split('/')[-1].removesuffix('_SendGoal')}"
        )
        for topic, types in listed
        if not OF_ALL_NODES.fullmatch(topic)
        and ("/_action/" not in topic or topic.endswith(SEND_GOAL))
    }


@pytest.mark.parametrize("page", NODES)
def test_the_table_names_all_topics_and_services_with_their_types(graph: Any, page: str) -> None:
    make, name, values = NODES[page]
    overrides = [Parameter(parameter, value=value) for parameter, value in values.items()]
    with graph.running(make, parameter_overrides=overrides) as node:
        graph.wait_for(lambda: "diagnostics" in interfaces(node, name))
        found, stated = interfaces(node, name), table(page)
    assert found == {topic: stated.get(topic) for topic in found}
    assert set(stated) - set(found) == NOT_AT_ONCE[page]


def test_the_table_names_all_frames_and_what_they_are_in(graph: Any) -> None:
    text = (ROOT / "docs/simulation.md").read_text(encoding="utf-8")
    (frames,) = re.findall(r"\| frame \| in \| \|\n(.*?)\n\n", text, flags=re.DOTALL)
    stated = {
        (child, parent)
        for child, parents in re.findall(r"^\| `(\w+)` \| (.*?) \|", frames, flags=re.MULTILINE)
        for parent in re.findall(r"`(\w+)`", parents)
    }
    found: set[tuple[str, str]] = set()

    def keep(message: TFMessage) -> None:
        found.update((each.child_frame_id, each.header.frame_id) for each in message.transforms)

    listener = graph.start(lambda **options: Node("listener", **options))
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    listener.create_subscription(TFMessage, "/tf", keep, 10)
    listener.create_subscription(TFMessage, "/tf_static", keep, latched)
    for mount in ("world", "base"):
        with graph.running(SimNode, parameter_overrides=[Parameter("camera_mount", value=mount)]):
            parent = "world" if mount == "world" else "base_footprint"
            graph.wait_for(
                lambda parent=parent: {("camera_link", parent), ("base_footprint", "odom")} <= found
            )
    links = {child for child, _ in found if child.startswith("l_")}
    assert len(links) == 11  # seven of the arm, four of the fingers
    assert {pair for pair in found if pair[0] not in links} == stated
