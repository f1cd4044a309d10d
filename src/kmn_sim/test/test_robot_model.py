"""The generated URDF against the model that it was made from."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from kmn_sim.robot import robot_model
from kmn_sim.robot.settings import RobotSettings
from kmn_sim.robot.urdf_export import link_name
from kmn_sim.world.simulation import Simulation

robotic = pytest.importorskip("robotic")
Simulate = Callable[..., Simulation]


def test_forward_kinematics_is_that_of_the_source(simulate: Simulate) -> None:
    simulation = simulate()
    robot, settings = simulation.robot, RobotSettings.load()
    source = robotic.Config()
    source.addFile(robotic.raiPath(settings.source))
    generator = np.random.default_rng(0)
    for _ in range(20):
        values = {}
        for name, (low, high) in robot.limits.items():
            value = generator.uniform(max(low, -3.0), min(high, 3.0))
            simulation.physics.resetJointState(robot.body, robot.link(name), value)
            if name == settings.gripper.joint:
                for follower in settings.gripper.followers:
                    simulation.physics.resetJointState(robot.body, robot.link(follower), value)
            values[name] = value
        base = [values.pop(name) for name in settings.base_names]
        source.getFrame(settings.base.frame).setJointState(base)
        for name, value in values.items():
            source.getFrame(name).setJointState([value])
        for name in (*settings.arm_names, *settings.finger_names):
            found = simulation.physics.getLinkState(robot.body, robot.link(name), 0, 1)[4:6]
            expected = source.getFrame(name)
            np.testing.assert_allclose(found[0], expected.getPosition(), atol=1e-6)
            rotation = np.reshape(simulation.physics.getMatrixFromQuaternion(found[1]), (3, 3))
            np.testing.assert_allclose(rotation, expected.getRotationMatrix(), atol=1e-6)


def test_limits_are_those_of_the_source(simulate: Simulate) -> None:
    limits = simulate().robot.limits
    source = robotic.Config()
    source.addFile(robotic.raiPath(RobotSettings.load().source))
    for name, (low, high) in limits.items():
        expected = source.getFrame(name, False)
        attributes = expected.getAttributes() if expected else {}
        if "limits" in attributes:
            assert (low, high) == pytest.approx(attributes["limits"])


def test_efforts_and_masses_reach_the_engine(simulate: Simulate) -> None:
    simulation = simulate()
    robot, settings = simulation.robot, RobotSettings.load()
    for name, motor in settings.joints.items():
        info = simulation.physics.getJointInfo(robot.body, robot.link(name))
        assert info[10:12] == (motor.effort, motor.velocity)
        links = {"base_x": "base_x_link", "base_y": "base_y_link", "base_yaw": "base_link"}
        assert info[12].decode() == links.get(name, link_name(name, settings.base.frame))
    masses = [
        simulation.physics.getDynamicsInfo(robot.body, link)[0]
        for link in range(simulation.physics.getNumJoints(robot.body))
    ]
    source = robotic.Config()
    source.addFile(robotic.raiPath(settings.source))
    expected = sum(source.getFrame(name).getMass() for name in source.getFrameNames())
    assert sum(masses) == pytest.approx(expected + 0.2, abs=0.1)  # the base's two small links


def test_a_missing_package_is_named_with_what_to_do(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setitem(sys.modules, "robotic", None)
    with pytest.raises(robot_model.RobotModelError, match="make setup-simulation"):
        robot_model.robot_urdf(RobotSettings.load())
    assert list((tmp_path / "kmn_sim").iterdir()) == []


def test_the_model_is_made_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    file = robot_model.robot_urdf(RobotSettings.load())
    made = file.stat().st_mtime_ns
    assert robot_model.robot_urdf(RobotSettings.load()).stat().st_mtime_ns == made
    assert file.parent.parent == tmp_path / "kmn_sim"
