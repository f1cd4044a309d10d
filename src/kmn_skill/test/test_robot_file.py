"""A robot is a file: another one is planned for by it alone, and a wrong one refused with why."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import robotic as ry
import yaml

from kmn_perception.configuration import resources
from kmn_perception.configuration.section import ConfigurationError
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_skill.experiments.settings import Experiment
from kmn_skill.planning.check import PlanRejected
from kmn_skill.planning.phases import PhaseName
from kmn_skill.planning.plan import PlanningFailed, PlanRequest
from kmn_skill.planning.planner import Planner
from kmn_skill.planning.planning_setup import PlanningSetup
from kmn_skill.planning.prototypes import Prototypes
from kmn_skill.planning.robot import RobotModel
from kmn_skill.planning.robot_chain import chain_of
from kmn_skill.planning.robot_frames import joint_problem
from kmn_skill.planning.solver import Solver
from kmn_skill.planning.world import CONTACTS, GRASP, PADS, TOOL, World

DOOR = KinematicModel.load("door")
PANDA = "panda_ranger"
Edit = Callable[[dict[str, Any]], None]


@pytest.fixture(scope="module")
def panda() -> PlanningSetup:
    return PlanningSetup.load(DOOR, PANDA)


def edited(robot: str, edit: Edit, folder: Path) -> PlanningSetup:
    """Return the set-up with a robot whose file was changed."""
    values = yaml.safe_load(resources.find("config/robots", robot).read_text())
    edit(values)
    file = folder / f"{robot}.yaml"
    file.write_text(yaml.safe_dump(values, sort_keys=False))
    return PlanningSetup.load(DOOR, file)


@pytest.mark.parametrize("robot", ["pr2", PANDA])
def test_the_tool_reaches_forwards_with_its_fingers_beside_each_other(robot: str) -> None:
    setup = PlanningSetup.load(DOOR, robot)
    world = World(setup, *DOOR.split(DOOR.prototype))
    positions = np.concatenate([setup.robot.home, np.zeros(2)])[None]
    positions[0, -3] = world.touching
    tool, left, right = world.poses(positions, [TOOL, *PADS])[0]
    across = left[:3, 3] - right[:3, 3]
    assert tool[:3, 1] == pytest.approx(across / np.linalg.norm(across), abs=1e-9)
    assert tool[:3, 0] == pytest.approx(left[:3, :3] @ setup.robot.planning.pads.forwards, abs=1e-6)
    assert np.linalg.det(tool[:3, :3]) == pytest.approx(1.0)
    assert tool[:3, 3] == pytest.approx((left[:3, 3] + right[:3, 3]) / 2.0)


@pytest.mark.parametrize("seed", range(3))
def test_another_robot_moves_as_its_model_turned_on_its_base(
    panda: PlanningSetup, seed: int
) -> None:
    robot = panda.robot
    model = ry.Config()
    model.addFile(ry.raiPath(robot.source))
    base = ["ranger_transX", "ranger_transY", "ranger_rot"]
    model.selectJoints([*base, *robot.model_joints[1:]])
    positions = np.random.default_rng(seed).uniform(-1.0, 1.0, len(robot.joint_names))
    positions[-1] = abs(positions[-1]) / 25.0
    turned = positions.copy()
    turned[2] += np.pi
    model.setJointState(turned)
    poses = chain_of(robot).poses(positions)
    for name in (*robot.model_joints[1:], *robot.gripper.followers):
        assert poses[name] == pytest.approx(model.getFrame(name).getTransform(), abs=1e-6)


@pytest.mark.parametrize("angle", [-0.9, 0.9])
def test_another_robot_opens_a_door_by_its_file_alone(panda: PlanningSetup, angle: float) -> None:
    theta, gamma = DOOR.split(np.array([0.1, -0.1, 0.2, 0.05, 0.05, 0.0, 0.03]))
    request = PlanRequest(theta, gamma, panda.robot.home, np.zeros(2), -0.7, angle)
    with Planner(panda, Prototypes.load("door", PANDA)) as planner:
        plan = planner.plan(request)
    assert plan.joint_names == panda.robot.joint_names
    world = World(panda, theta, gamma)
    held = plan.phase(PhaseName.OPEN).last
    positions = np.hstack([plan.positions, plan.object_joints])[held].copy()
    positions[len(plan.joint_names) - 1] = world.touching  # where the handle stops the fingers
    pads = world.poses(positions[None], [*PADS, *CONTACTS, GRASP])[0, :, :3, 3]
    assert pads[:2] == pytest.approx(pads[2:4], abs=1e-3)
    assert plan.object_joints[-1, 0] == pytest.approx(angle, abs=0.01)


def test_a_wide_hand_takes_a_lever_in_a_deep_recess_nearer_to_its_end() -> None:
    """Held at its usual place, its palm would touch the frame."""
    experiment = Experiment.load()
    shipped = PlanningSetup.load(experiment.kinematic_model(in_room=True), PANDA)
    patient = shipped.settings.planner._replace(attempt_limit=100.0)  # on a busy machine
    room = replace(shipped, settings=replace(shipped.settings, planner=patient))
    values = np.array([0.01, 0.16, 0.6, 0.02, -0.08, -0.02, 0.04])
    request = experiment.request(room, values, "push", recess=0.09)
    solutions = Prototypes.load("door", PANDA)
    usual, other = list(solutions.guesses(request, count=1, spread=0.0, holds=2))
    assert (usual.hold, other.hold) == (0, 1)
    solver = Solver(room)
    with pytest.raises(PlanRejected, match="no motion was found"):
        solver.plan(request, usual.solution, usual.name)
    with Planner(room, solutions) as planner:
        plan = planner.plan(request)
    world = solver.world(replace(request, hold=1))
    positions = np.hstack([plan.positions, plan.object_joints])[-1].copy()
    positions[len(plan.joint_names) - 1] = world.touching
    pads = world.poses(positions[None], [*PADS, *CONTACTS])[0, :, :3, 3]
    assert pads[:2] == pytest.approx(pads[2:], abs=1e-3)


def set_at(*keys: str, value: Any) -> Edit:
    def edit(values: dict[str, Any]) -> None:
        for key in keys[:-1]:
            values = values[key]
        values[keys[-1]] = value

    return edit


def rename_joint(values: dict[str, Any]) -> None:
    joints = values["joints"]
    values["joints"] = {
        name.replace("l_panda_joint4", "elbow_9"): joint for name, joint in joints.items()
    }
    values["planning"]["bodies"]["elbow"]["joint"] = "elbow_9"
    arm = values["controllers"]["arm"]
    arm["joints"] = [name.replace("l_panda_joint4", "elbow_9") for name in arm["joints"]]


@pytest.mark.parametrize(
    ("edit", "text"),
    [
        (rename_joint, "panda_ranger': joints: its model .* has no frame 'elbow_9'"),
        (set_at("source", value="my/arm.g"), "source: the package robotic has no model 'my/arm.g'"),
        (
            lambda v: v["gripper"]["followers"].append("thumb"),
            "gripper: followers: its model .* has no frame 'thumb'",
        ),
        (
            set_at("planning", "bodies", "palm", "meshes", value=["hand_0"]),
            "planning: bodies: palm: its model .* has no frame 'hand_0'",
        ),
        (
            set_at("planning", "bodies", "palm", "meshes", value=["ranger_base"]),
            "planning: bodies: palm: 'ranger_base' has no mesh",
        ),
        (
            set_at("joints", "l_panda_joint4", "home", value=0.5),
            "l_panda_joint4: 'home' must be within -3.0718 to -0.0698, found 0.5",
        ),
        (
            set_at("planning", "pads", "left", "point", value=[0.0, 0.06, 0.045]),
            "the pads are 0.060 m apart where .* does not take 'handle' of 0.050 m",
        ),
        (
            set_at("planning", "grip", "open", value=0.02),
            "closed and 0.040 m where it is open, which does not take 'handle' of 0.050 m",
        ),
    ],
)
def test_a_file_that_does_not_fit_its_model_is_refused(
    tmp_path: Path, edit: Edit, text: str
) -> None:
    setup = edited(PANDA, edit, tmp_path)
    with pytest.raises(ConfigurationError, match=text):
        World(setup, *DOOR.split(DOOR.prototype))


def test_the_planner_tells_what_does_not_fit(tmp_path: Path) -> None:
    setup = edited("pr2", set_at("source", value="my/arm.g"), tmp_path)
    theta, gamma = DOOR.split(DOOR.prototype)
    request = PlanRequest(theta, gamma, setup.robot.home, np.zeros(2), -0.7, -0.9)
    with (
        Planner(setup, Prototypes.load("door", "pr2")) as planner,
        pytest.raises(PlanningFailed, match="has no model 'my/arm.g'"),
    ):
        planner.plan(request)


@pytest.mark.parametrize(
    ("edit", "text"),
    [
        (
            set_at("base", "limits", "base_x", value=[5.0, -5.0]),
            "base: limits: 'base_x' is wrong: lower 5 is not below upper -5",
        ),
        (
            set_at("base", "kind", value="differential"),
            "'kind' must be 'omnidirectional' or 'fixed', found",
        ),
        (
            set_at("base", "limits", value={"x": [-1.0, 1.0]}),
            "'limits' must be of the first joints, base_x, base_y, base_yaw, found x",
        ),
        (lambda v: v["planning"].pop("grip"), "planning: key 'grip' is missing"),
        (set_at("planning", "collisions", "blunt", value=["tail"]), "there is no body 'tail'"),
        (
            set_at("planning", "bodies", "palm", "joint", value="l_panda_hand_joint"),
            "planning: bodies: palm: there is no joint 'l_panda_hand_joint'",
        ),
        (
            set_at("planning", "pads", "right", "joint", value="thumb"),
            "planning: pads: right: there is no joint 'thumb'",
        ),
    ],
)
def test_a_wrong_file_is_refused_with_the_key(tmp_path: Path, edit: Edit, text: str) -> None:
    with pytest.raises(ConfigurationError, match=text):
        edited(PANDA, edit, tmp_path)


def test_motions_of_an_own_robot_are_beside_its_file(tmp_path: Path) -> None:
    mine = tmp_path / "mine.yaml"
    mine.write_text(resources.find("config/robots", PANDA).read_text())
    with pytest.raises(FileNotFoundError, match="make_prototypes makes a robot's motions"):
        Prototypes.load("door", mine)
    shipped = Prototypes.load("door", PANDA)
    (tmp_path / "mine").mkdir()
    shipped.save(tmp_path / "mine" / "door.json")
    assert (
        Prototypes.load("door", mine).joints
        == shipped.joints
        == PlanningSetup.load(DOOR, mine).joint_names
    )


def test_the_robot_s_own_name_is_its_file_s() -> None:
    folder = resources.share_directory() / "config/robots"
    for file in folder.glob("*.yaml"):
        assert RobotModel.load(file).name == file.stem


def test_a_model_of_ones_own_is_named_by_its_whole_path(tmp_path: Path) -> None:
    mine = tmp_path / "mine.g"
    mine.write_text(f"Include: <{ry.raiPath(RobotModel.load(PANDA).source)}>\n")
    setup = edited(PANDA, set_at("source", value=str(mine)), tmp_path)
    world = World(setup, *DOOR.split(DOOR.prototype))
    shipped = World(PlanningSetup.load(DOOR, PANDA), *DOOR.split(DOOR.prototype))
    configuration = np.concatenate([setup.robot.home, np.zeros(2)])[None]
    frames = list(setup.robot.model_joints)
    found, expected = (each.poses(configuration, frames) for each in (world, shipped))
    np.testing.assert_allclose(found, expected)


@pytest.mark.parametrize(
    ("attributes", "is_gripper", "text"),
    [
        ({}, False, "is no joint"),
        ({"joint": "hinge", "axis": [0.0, -1.0, 0.0]}, False, "is no joint about or along x"),
        ({"joint": "hingeY", "axis": [0.0, -1.0, 0.0]}, False, "is no joint about or along x"),
        ({"joint": "ball"}, False, "but 'ball'"),
        ({"joint": "transX", "joint_scale": -1.0}, True, "has the joint_scale -1"),
    ],
)
def test_joints_that_the_planner_would_take_for_others_are_refused(
    attributes: dict[str, Any], is_gripper: bool, text: str
) -> None:
    assert text in joint_problem(attributes, is_gripper)


def test_joints_about_and_along_axes_are_taken() -> None:
    assert not joint_problem({"joint": "hingeX"}, True)
    assert not joint_problem({"joint": "transZ", "joint_scale": -1.0}, False)
