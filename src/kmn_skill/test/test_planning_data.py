"""Object, robot and solutions are data: another one is planned for, and a wrong one refused."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from kmn_perception.configuration import resources
from kmn_perception.configuration.section import ConfigurationError
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_skill.planning import layout
from kmn_skill.planning.check import PlanRejected, check
from kmn_skill.planning.phases import PhaseName
from kmn_skill.planning.plan import PlanRequest
from kmn_skill.planning.planner import Planner
from kmn_skill.planning.planning_setup import PlanningSetup
from kmn_skill.planning.policy import Policy, pairs
from kmn_skill.planning.prototypes import Prototypes, Solution
from kmn_skill.planning.robot import RobotModel
from kmn_skill.planning.settings import SkillSettings
from kmn_skill.planning.timing import timed_plan
from kmn_skill.planning.transfer import refine, transfer
from kmn_skill.planning.world import GRASP, STEM, World

DOOR = KinematicModel.load("door")
OPEN_TO = -0.9


def edited(kind: str, name: str, edit: Callable[[dict[str, Any]], None], folder: Path) -> Path:
    """Return a copy of a shipped file with some of its values changed."""
    values = yaml.safe_load(resources.find(kind, name).read_text())
    edit(values)
    file = folder / f"{name}.yaml"
    file.write_text(yaml.safe_dump(values, sort_keys=False))
    return file


@pytest.fixture(scope="module")
def other(tmp_path_factory: pytest.TempPathFactory) -> KinematicModel:
    """Return a door whose lever is 6 cm higher than that of the shipped one."""

    def raise_lever(values: dict[str, Any]) -> None:
        values["name"] = "high_lever"
        lever = next(body for name, body in values["bodies"].items() if name == "handle")
        for place in (lever["centre"], values["joints"]["handle"]["origin"]):
            place[2]["constant"] += 0.06

    folder = tmp_path_factory.mktemp("models")
    return KinematicModel.load(edited("config/models", "door", raise_lever, folder))


def test_the_planner_plans_for_the_model_that_it_is_given(other: KinematicModel) -> None:
    setup = PlanningSetup.load(other)
    theta, gamma = other.split(other.prototype)
    request = PlanRequest(theta, gamma, setup.robot.home, np.zeros(2), -0.7, OPEN_TO)
    with Planner(setup, Prototypes.load("door")) as planner:
        plan = planner.plan(request)
    world = World(setup, theta, gamma)
    assert check(plan, request, world).contact_error < 1e-3
    with pytest.raises(PlanRejected, match="mm apart"):
        check(plan, request, World(PlanningSetup.load(DOOR), theta, gamma))
    # The hand is at the lever of the kinematic model.
    grasped = plan.phase(PhaseName.PRESS).first
    positions = np.hstack([plan.positions, plan.object_joints])[grasped]
    place = world.poses(positions[None], ["l_wrist_roll_joint"])[0, 0, 2, 3]
    lever = other.moved_cubes(other.prototype, {})[1][2, 3]
    assert place == pytest.approx(lever, abs=0.02)


def test_object_and_robot_can_be_sent_to_another_process() -> None:
    setup = PlanningSetup.load(DOOR)
    sent = pickle.loads(pickle.dumps(setup))
    assert sent.joint_names == setup.joint_names
    np.testing.assert_array_equal(sent.robot.home, setup.robot.home)
    np.testing.assert_array_equal(sent.model.limits, setup.model.limits)


def test_a_model_without_actions_is_refused() -> None:
    with pytest.raises(ConfigurationError, match="'box_a' has no 'actions'"):
        PlanningSetup.load(KinematicModel.load("box_a"))


def test_solutions_for_other_joints_are_refused_with_both() -> None:
    setup = PlanningSetup.load(DOOR)
    solutions = replace(Prototypes.load("door"), joints=("slide", *setup.joint_names[1:]))
    with pytest.raises(ConfigurationError, match=r"joints slide, .*; those of .* are base_x, .*"):
        Planner(setup, solutions)


def test_solutions_are_read_as_they_were_saved(tmp_path: Path) -> None:
    solutions = Prototypes.load("door")
    solutions.save(tmp_path / "mine.json")
    found = Prototypes.load(str(tmp_path / "mine.json"))
    assert found.joints == solutions.joints == PlanningSetup.load(DOOR).joint_names
    assert found.solutions.keys() == solutions.solutions.keys()
    for name, known in solutions.solutions.items():
        for one, same in zip(known, found.solutions[name], strict=True):
            np.testing.assert_array_equal(same.gamma, one.gamma)
            np.testing.assert_array_equal(same.path, one.path)


def test_the_solutions_begin_at_the_robot_s_home() -> None:
    home = RobotModel.load("pr2").home
    for known in Prototypes.load("door").solutions.values():
        for _, path in known:
            np.testing.assert_allclose(path[0, layout.ROBOT], home)


def remove(*keys: str) -> Callable[[dict[str, Any]], None]:
    def edit(values: dict[str, Any]) -> None:
        for key in keys[:-1]:
            values = values[key]
        del values[keys[-1]]

    return edit


@pytest.mark.parametrize(
    ("edit", "text"),
    [
        (remove("joints", "base_x", "home"), "pr2.yaml: joints: base_x: key 'home' is missing"),
        (remove("planning", "pads", "left"), "planning: pads: key 'left' is missing"),
        (remove("planning", "bodies", "palm"), "planning: there is no body 'palm'"),
        (lambda v: v["gripper"].update(joint="thumb"), "must be the gripper's, 'thumb'"),
        (
            lambda v: v["joints"]["base_y"].update(planned=[0.6, 0.0]),
            r"planned\[1\] must be",
        ),
        (lambda v: v.update(continuous=["thumb"]), "continuous: there is no joint 'thumb'"),
        (
            lambda v: v["controllers"]["base"].update(type="gripper_command"),
            "a gripper_command is for 'l_gripper_l_finger_joint' alone, found base_x",
        ),
        (
            lambda v: v["controllers"]["arm"].update(type="velocity"),
            "controllers: arm: a velocity is for 'base_x, base_y, base_yaw' alone, found l_should",
        ),
        (
            lambda v: (
                v["controllers"]["base"].update(type="velocity"),
                v["continuous"].remove("base_yaw"),
            ),
            "continuous: must name 'base_yaw', which odometry tells within one turn",
        ),
        (
            lambda v: v["controllers"]["arm"]["joints"].append("base_x"),
            "controllers: each joint must have one, found base_x",
        ),
        (remove("controllers", "gripper"), "controllers: each joint must have one, found base_x"),
        (lambda v: v.update(wheels=4), "unknown key 'wheels'"),
    ],
)
def test_a_wrong_robot_is_refused_with_the_key(
    tmp_path: Path, edit: Callable[[dict[str, Any]], None], text: str
) -> None:
    with pytest.raises(ConfigurationError, match=text):
        RobotModel.load(edited("config/robots", "pr2", edit, tmp_path))


def test_a_wrong_policy_is_refused_with_the_key(tmp_path: Path) -> None:
    file = edited("config/skill", "policy", lambda v: v["policy"].update(margin=-1.0), tmp_path)
    with pytest.raises(ConfigurationError, match=r"policy.yaml: policy: 'margin' .*found -1.0"):
        SkillSettings.load(file)


@pytest.mark.parametrize("axes", [6, 7])
def test_columns_are_those_of_any_arm(axes: int) -> None:
    base = ["x", "y", "yaw"]
    names = np.array([*base, *(f"arm_{i}" for i in range(axes)), "gripper", "hinge", "handle"])
    robot, door = names[layout.ROBOT], names[layout.OBJECT_JOINTS]
    assert robot[layout.BASE].tolist() == base
    assert robot[layout.ARM].tolist() == [f"arm_{i}" for i in range(axes)]
    assert robot[layout.BASE_AND_ARM].size == 3 + axes
    assert (robot[layout.GRIPPER], *door[[layout.MOVED, layout.LATCH]]) == (
        "gripper", "hinge", "handle"
    )  # fmt: skip


def weld_the_forearm(values: dict[str, Any]) -> None:
    """Leave six axes to the arm."""
    del values["joints"]["l_forearm_roll_joint"]
    values["continuous"].remove("l_forearm_roll_joint")
    values["controllers"]["arm"]["joints"].remove("l_forearm_roll_joint")
    values["planning"]["bodies"]["forearm"]["joint"] = "l_elbow_flex_joint"


def test_a_robot_with_six_axes_has_its_policy_plan_and_check(tmp_path: Path) -> None:
    robot = RobotModel.load(edited("config/robots", "pr2", weld_the_forearm, tmp_path))
    setup = PlanningSetup(DOOR, robot, SkillSettings.load())
    theta, gamma = DOOR.split(DOOR.prototype)
    request = PlanRequest(theta, gamma, robot.home, np.zeros(2), -0.7, OPEN_TO)
    solutions = Prototypes.load("door")
    welded = solutions.joints.index("l_forearm_roll_joint")
    path = np.delete(solutions.solutions["pull"][0].path, welded, axis=1)
    guess = transfer(Solution(gamma, path), DOOR, setup.action, request)
    world = World(setup, theta, gamma)
    policy = Policy(world, request, setup.settings.planner.coarse, pairs(world))
    assert policy.problem.nlp().getDimension() == guess.size == 20 * 12
    path = refine(guess, request.configuration, setup.settings.planner.fine)
    plan = timed_plan(path, request, world)
    assert plan.positions.shape == (len(plan.times), 10)
    np.testing.assert_allclose(plan.object_joints[-1], [OPEN_TO, -0.49], atol=1e-4)
    with pytest.raises(PlanRejected, match="gripper and handle are .* mm apart"):
        check(plan, request, world)  # its forearm is welded at another angle


def test_the_stem_is_that_of_the_kinematic_model() -> None:
    gamma = np.array([0.0, 0.1, 0.02, 0.05])
    assert DOOR.stem is not None
    world = World(PlanningSetup.load(DOOR), np.zeros(3), gamma)
    positions = np.zeros((1, 13))
    box = world.object_boxes()[STEM]
    pose = world.poses(positions, [box.frame])[0, 0]
    centre, size = DOOR.stem.cuboid(gamma)
    np.testing.assert_allclose(pose[:3, :3] @ box.centre + pose[:3, 3], centre, atol=1e-9)
    np.testing.assert_allclose(box.size, size)
    assert world.poses(positions, [GRASP])[0, 0, 0, 3] < centre[0]  # behind the lever
