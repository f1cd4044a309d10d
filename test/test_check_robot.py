"""check_robot says what there is and what is missing, of a running system and of none."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import rclpy
import yaml
from domain_coordinator import domain_id
from rclpy.node import Node
from rclpy.parameter import Parameter

from kmn_perception.configuration import resources
from kmn_perception.ros.morph_node import MorphNode
from programs import start

pytest.importorskip("pybullet")
pytest.importorskip("robotic")
from door_client import SEED  # noqa: E402
from kmn_sim.ros.sim_node import SimNode  # noqa: E402
from kmn_skill.planning.urdf_limits import JointLimits, differences, limits_of_urdf  # noqa: E402
from kmn_skill.ros.robot_listener import RobotListener  # noqa: E402

TIMEOUT = 60.0  # seconds
NAMESPACE = "/left"
CHECK = [sys.executable, "-m", "kmn_skill", "check_robot"]
Edit = Callable[[dict[str, Any]], None]


def checked(domain: int, *arguments: str) -> tuple[int, str]:
    """Run the program; return its exit status and what it prints, one line a finding."""
    process = start([*CHECK, *arguments], domain)
    printed, _ = process.communicate(timeout=TIMEOUT)
    return process.returncode, printed.replace("\n" + " " * 10, " ")


@pytest.fixture(scope="module")
def system(graph: Any, domain: int) -> Iterator[int]:
    """Return the domain in which a robot, its camera and perception run in a namespace."""
    sim = {"publish_clock": True, "placement": "random", "seed": SEED, "camera_rate": 4.0}
    alone = ["--ros-args", "-r", f"__ns:={NAMESPACE}"]
    for make, values in ((SimNode, sim), (MorphNode, {"use_sim_time": True})):
        overrides = [Parameter(name, value=value) for name, value in values.items()]
        graph.start(make, parameter_overrides=overrides, cli_args=alone)
    yield domain


def edited(folder: Path, edit: Edit) -> str:
    """Write a robot's file that was changed; return its path."""
    values = yaml.safe_load(resources.find("config/robots", "pr2").read_text())
    edit(values)
    file = folder / "robot.yaml"
    file.write_text(yaml.safe_dump(values, sort_keys=False))
    return str(file)


def test_nothing_is_missing_of_a_system_that_runs(system: int, tmp_path: Path) -> None:
    file = tmp_path / "findings.json"
    arguments = ("--namespace", NAMESPACE, "--control", "action", "--json", str(file))
    status, printed = checked(system, *arguments)
    assert status == 0, printed
    assert "ok      joint_states: all 11 joints, " in printed
    assert "'camera_depth_optical_frame' in 'world' is known" in printed
    assert "the door is seen" in printed
    assert "robot_description: plans keep its limits" in printed
    found = json.loads(file.read_text())
    assert found["missing"] == 0
    assert len(found["findings"]) == 11


def test_of_nothing_each_thing_is_missing() -> None:
    with domain_id() as empty:
        status, printed = checked(empty)
    assert status == 1
    missing = [line.split(": ")[0] for line in printed.splitlines() if line.startswith("missing")]
    assert missing == [
        f"missing {subject}"
        for subject in (
            "joint_states",
            "transform to the base",
            "transform to the camera",
            "controllers",
            "robot_description",
            "camera",
            "morphing_parameters",
        )
    ]
    assert printed.count("to do: ") == len(missing)
    assert "7 of 9 missing" in printed


def test_simulated_time_that_is_found_late_counts_from_then_on(system: int) -> None:
    """As on a busy machine: when the listening begins, nothing is known of anybody."""
    rclpy.init(domain_id=system)
    try:
        listener = RobotListener(Node("late", namespace=NAMESPACE))
        listener.listen(discovery=0.0, duration=4.0)
        assert listener.joints.messages
        assert max(map(abs, listener.joints.ages)) < 2.0
        assert not listener.missing_transform("world", "base_footprint", 2.0)
    finally:
        rclpy.shutdown()


def _other_controllers(values: dict[str, Any]) -> None:
    values["controllers"]["base"].update(type="velocity", name="cmd_vel")
    values["controllers"]["arm"]["name"] = "arm/follow_joint_trajectory"
    values["controllers"]["gripper"]["type"] = "gripper_command"
    values["joints"]["l_elbow_flex_joint"]["planned"] = [9.0, 6.0]


def _foreign_joint(values: dict[str, Any]) -> None:
    values["planning"]["grip"]["open"] = 0.01
    joint = values["joints"].pop("base_x")
    values["joints"] = {"wheel_x": joint, **values["joints"]}
    values["base"]["limits"] = {"wheel_x": [-1.0, 1.0], **values["base"]["limits"]}
    del values["base"]["limits"]["base_x"]
    values["controllers"]["base"]["joints"][0] = "wheel_x"


@pytest.mark.parametrize(
    ("edit", "texts"),
    [
        (
            _other_controllers,
            [
                "missing controller 'base': nobody listens to 'cmd_vel'",
                "missing controller 'arm': nobody serves the action 'arm/follow_joint_trajectory'",
                "missing controller 'gripper': 'l_gripper_controller/follow_joint_trajectory' is "
                "control_msgs/action/FollowJointTrajectory, expected "
                "control_msgs/action/GripperCommand",
                "missing robot_description: l_elbow_flex_joint moves 3.3 a second there",
            ],
        ),
        (
            _foreign_joint,
            [
                "missing joint_states: the state lacks the joints wheel_x",
                "missing pads: robot 'pr2': planning: the pads are",
            ],
        ),
    ],
)
def test_what_is_missing_is_named_with_what_to_do(
    system: int, tmp_path: Path, edit: Edit, texts: list[str]
) -> None:
    robot = edited(tmp_path, edit)
    arguments = ("--namespace", NAMESPACE, "--control", "action", "--robot", robot)
    status, printed = checked(system, *arguments)
    assert status == 1
    lines = [line for line in printed.splitlines() if line.startswith("missing")]
    assert len(lines) == len(texts), printed
    for line, text in zip(lines, texts, strict=True):
        assert line.startswith(text)


URDF = """<robot name="r">
<joint name="a" type="revolute"><limit lower="-1.0" upper="2.0" velocity="1.5"/></joint>
<joint name="b" type="continuous"><limit velocity="1.0"/></joint>
<joint name="c" type="fixed"/>
</robot>"""


def test_limits_of_a_urdf_are_compared_with_those_of_plans() -> None:
    urdf, infinite = limits_of_urdf(URDF), float("inf")
    assert urdf == {"a": JointLimits(-1.0, 2.0, 1.5), "b": JointLimits(-infinite, infinite, 1.0)}

    def found(**planned: JointLimits) -> str:
        return "; ".join(differences(planned, urdf, 0.01, 0.001))

    assert found(a=JointLimits(-1.005, 2.0, 1.5), b=JointLimits(-9.0, 9.0, 0.5)) == ""
    assert found(a=JointLimits(-1.2, 2.0, 1.0)) == (
        "a goes from -1 to 2 there, but from -1.2 to 2 in plans"
    )
    assert found(b=JointLimits(0.0, 1.0, 1.1)) == "b moves 1 a second there, 1.1 in plans"
    assert found(d=JointLimits(0.0, 1.0, 1.0)) == "it has no joint d"
    with pytest.raises(ValueError, match="it is no XML"):
        limits_of_urdf("<robot")
