"""The simulator's robot is a file: another one moves as its model, a wrong one is refused."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from kmn_perception.configuration import resources
from kmn_perception.configuration.section import ConfigurationError
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_sim.control.trajectory import Command, Waypoint
from kmn_sim.robot.robot_model import robot_urdf
from kmn_sim.robot.settings import RobotSettings
from kmn_sim.world.scenario import Scenario
from kmn_sim.world.settings import WorldSettings
from kmn_sim.world.simulation import Simulation

robotic = pytest.importorskip("robotic")
PANDA = "panda_ranger"
Edit = Callable[[dict[str, Any]], None]


def test_another_robot_moves_as_its_model_turned_on_its_base() -> None:
    settings, model = RobotSettings.load(PANDA), KinematicModel.load("door")
    scenario, world = Scenario(model, model.prototype), WorldSettings.load(PANDA)
    source = robotic.Config()
    source.addFile(robotic.raiPath(settings.source))
    base = ["ranger_transX", "ranger_transY", "ranger_rot"]
    source.selectJoints([*base, *settings.arm_names, settings.gripper.joint])
    generator = np.random.default_rng(0)
    with closing(
        Simulation(scenario, world, renderer="software", allow_partial=True)
    ) as simulation:
        robot, physics = simulation.robot, simulation.physics
        low, high = np.clip(np.transpose(list(robot.limits.values())), -1.5, 1.5)
        for _ in range(5):
            positions = generator.uniform(low, high)
            for name, position in zip(settings.names, positions, strict=True):
                physics.resetJointState(robot.body, robot.link(name), position)
            (follower,) = settings.gripper.followers
            physics.resetJointState(robot.body, robot.link(follower), positions[-1])
            turned = positions + np.pi * (np.arange(len(positions)) == 2)
            source.setJointState(turned)
            for name in (*settings.arm_names, *settings.finger_names):
                found = physics.getLinkState(robot.body, robot.link(name), 0, 1)
                assert found[4] == pytest.approx(source.getFrame(name).getPosition(), abs=1e-5)


def test_its_fingers_slide_together_and_its_arm_holds_its_weight() -> None:
    model = KinematicModel.load("door")
    scenario, world = Scenario(model, model.prototype), WorldSettings.load(PANDA)
    with closing(
        Simulation(scenario, world, renderer="software", allow_partial=True)
    ) as simulation:
        robot, physics, grip = simulation.robot, simulation.physics, world.robot.gripper
        simulation.controllers.accept(Command((grip.joint,), [Waypoint(0.5, (0.03,))]), 0.0)
        simulation.run(1.0)
        state = robot.state()
        fingers = [
            physics.getJointState(robot.body, robot.link(name))[0]
            for name in world.robot.finger_names
        ]
        assert fingers == pytest.approx([0.03, 0.03], abs=1e-4)
        home = [*list(world.robot.joints.values())[:-1]]
        assert state.positions[:-1] == pytest.approx([motor.home for motor in home], abs=1e-3)


def edited(folder: Path, edit: Edit) -> RobotSettings:
    values = yaml.safe_load(resources.find("config/robots", PANDA).read_text())
    edit(values)
    file = folder / "mine.yaml"
    file.write_text(yaml.safe_dump(values, sort_keys=False))
    return RobotSettings.load(file)


def rename_a_joint(values: dict[str, Any]) -> None:
    joints = values["joints"]
    values["joints"] = {name.replace("joint4", "elbow"): joints[name] for name in joints}
    arm = values["controllers"]["arm"]
    arm["joints"] = [name.replace("joint4", "elbow") for name in arm["joints"]]


def follow_what_does_not_move(values: dict[str, Any]) -> None:
    values["gripper"]["followers"] = ["l_panda_hand_joint"]
    values["simulation"]["masses"]["l_panda_hand_joint"] = 0.7


@pytest.mark.parametrize(
    ("edit", "text"),
    [
        (rename_a_joint, "'panda_ranger': its model .* has no joint 'l_panda_elbow'"),
        (lambda v: v.update(source="my/arm.g"), "source: .* has no model 'my/arm.g'"),
        (
            lambda v: v["simulation"]["masses"].pop("l_panda_joint3"),
            "masses: that of 'l_panda_joint3' is missing, its model has none",
        ),
        (
            follow_what_does_not_move,
            "'l_panda_hand_joint' is no joint about or along an axis",
        ),
    ],
)
def test_a_file_that_does_not_fit_its_model_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, edit: Edit, text: str
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    settings = edited(tmp_path, edit)
    with pytest.raises(ConfigurationError, match=text):
        robot_urdf(settings)
    assert list((tmp_path / "kmn_sim").iterdir()) == []


@pytest.mark.parametrize(
    ("edit", "text"),
    [
        (
            lambda v: v["base"]["limits"].update(base_yaw=[1.0, -1.0]),
            "base: limits: 'base_yaw' is wrong: lower 1 is not below upper -1",
        ),
        (lambda v: v.pop("camera"), "key 'camera' is missing"),
        (lambda v: v["base"].update(limits={"x": [-1.0, 1.0]}), "of the first joints, base_x, "),
    ],
)
def test_a_wrong_file_is_refused_with_the_key(tmp_path: Path, edit: Edit, text: str) -> None:
    with pytest.raises(ConfigurationError, match=text):
        edited(tmp_path, edit)
