"""operate_joint chooses among the actions of one object: two drawers, side by side."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml
from action_msgs.msg import GoalStatus
from rclpy.parameter import Parameter

from kmn_msgs.action import OperateJoint
from kmn_perception.configuration import resources
from kmn_perception.configuration.section import ConfigurationError
from kmn_perception.model.kinematic_model import KinematicModel

pytest.importorskip("pybullet")
pytest.importorskip("robotic")
from door_client import PATIENT, TrueDoorClient  # noqa: E402
from kmn_skill.execution.errors import GoalError  # noqa: E402
from kmn_skill.experiments.action_option import chosen_action  # noqa: E402
from kmn_skill.ros.goal_interfaces import OperateJointInterface  # noqa: E402
from kmn_skill.ros.locked_action_client import LockedActionClient  # noqa: E402
from kmn_skill.ros.skill_node import SkillNode  # noqa: E402

BESIDE = 0.65  # metres from the one drawer to the other


def two_drawers(folder: Path) -> Path:
    """Write the file of the shipped drawer with another one beside it, and their motions."""
    content = yaml.safe_load(resources.find("config/models", "drawer").read_text())
    content["name"] = "two_drawers"
    bodies, joints, mechanics = content["bodies"], content["joints"], content["mechanics"]
    for name in ("cabinet", "front", "bar"):
        x, _, z = bodies[name]["centre"]
        bodies[f"other_{name}"] = {"centre": [x, BESIDE, z], "size": bodies[name]["size"]}
    names = {"cabinet": "cabinet", "front": "other_front", "bar": "other_bar"}
    for name in ("slide", "mount"):
        moved = {key: names[joints[name][key]] for key in ("body", "parent")}
        joints[f"other_{name}"] = {**joints[name], **moved}
    for name in ("front", "bar"):
        mechanics["bodies"][f"other_{name}"] = mechanics["bodies"][name]
    mechanics["joints"]["other_slide"] = mechanics["joints"]["slide"]
    grasp = {"body": "other_bar", "axis": "z"}
    content["actions"]["open"]["motions"] = "drawer"
    content["actions"]["open_other"] = {
        "joint": "other_slide",
        "target": -0.2,
        "grasp": grasp,
        "motions": "other.json",
    }
    motions = json.loads(
        resources.find("config/skill/prototypes/pr2", "drawer", ".json").read_text()
    )
    motions["joints"][-2] = "other_slide"
    (folder / "other.json").write_text(json.dumps(motions), encoding="utf-8")
    file = folder / "two_drawers.yaml"
    file.write_text(yaml.safe_dump(content, sort_keys=False), encoding="utf-8")
    return file


def test_the_joint_and_the_side_choose_the_action(tmp_path: Path) -> None:
    file = two_drawers(tmp_path)
    content = yaml.safe_load(file.read_text())
    shut = {**content["actions"]["open_other"], "target": 0.1}
    content["joints"]["other_slide"]["limits"] = [-0.4, 0.2]
    content["actions"]["push_other"] = shut
    file.write_text(yaml.safe_dump(content, sort_keys=False), encoding="utf-8")
    interface = OperateJointInterface(KinematicModel.load(file))

    def chosen(joint: str, target: float) -> tuple[int, float]:
        goal = interface.goal(OperateJoint.Goal(joint=joint, target=target))
        return goal.action, goal.target

    assert chosen("", math.nan) == (0, -0.3)
    assert chosen("slide", 0.1) == (0, 0.1)
    assert chosen("other_slide", math.nan) == (1, -0.2)
    assert chosen("other_slide", -0.3) == (1, -0.3)
    assert chosen("other_slide", 0.15) == (2, 0.15)
    with pytest.raises(GoalError, match="'hinge' is asked for, expected 'slide' or 'other_slide'"):
        chosen("hinge", math.nan)


def test_a_program_is_for_the_action_that_is_named(tmp_path: Path) -> None:
    model = KinematicModel.load(two_drawers(tmp_path))
    assert chosen_action(model, "").actions == model.actions
    assert chosen_action(model, "open_other").actions == model.actions[1:]
    with pytest.raises(ConfigurationError, match="no action 'lift', expected open or open_other"):
        chosen_action(model, "lift")


@pytest.fixture(scope="module")
def system(graph: Any, tmp_path_factory: pytest.TempPathFactory) -> Iterator[TrueDoorClient]:
    file = str(two_drawers(tmp_path_factory.mktemp("models")))
    made = graph.start(lambda **_: TrueDoorClient(graph))
    made.start_simulator(model=file)
    given = {**PATIENT, "use_sim_time": True, "model": file, "retries": 0}
    overrides = [Parameter(name, value=value) for name, value in given.items()]
    graph.start(SkillNode, parameter_overrides=overrides)
    yield made
    made.stop_simulator()


def test_the_other_drawer_is_opened_and_this_one_stays(system: TrueDoorClient) -> None:
    operate = LockedActionClient(system, OperateJoint, "operate_joint")
    assert operate.wait_for_server(30.0)
    system.graph.wait_for(lambda: system.perceived)
    goal = OperateJoint.Goal(joint="other_slide", target=math.nan)
    answer = system.wait(system.send_goal(operate, goal).get_result_async())
    assert answer.result.reason == ""
    assert answer.status == GoalStatus.STATUS_SUCCEEDED
    assert answer.result.position == pytest.approx(-0.2, abs=0.02)
    places = dict(zip(system.doors[-1].name, system.doors[-1].position, strict=True))
    assert places["slide"] == pytest.approx(0.0, abs=0.005)
    assert places["other_slide"] == pytest.approx(-0.2, abs=0.02)
