"""A robot that stands where it is, in the simulator, opens a door by nodes that know it from TF."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
from action_msgs.msg import GoalStatus
from rclpy.parameter import Parameter

from kmn_perception.model.kinematic_model import KinematicModel

pytest.importorskip("pybullet")
pytest.importorskip("robotic")
from fixed_robot import write_robot  # noqa: E402

from door_client import PATIENT, TrueDoorClient  # noqa: E402
from kmn_skill.ros.skill_node import SkillNode  # noqa: E402

OPENED = -0.5  # radians


@pytest.fixture(scope="module")
def system(graph: Any, tmp_path_factory: pytest.TempPathFactory) -> Iterator[TrueDoorClient]:
    robot = str(write_robot(tmp_path_factory.mktemp("robot")))
    made = graph.start(lambda **_: TrueDoorClient(graph))
    made.start_simulator(robot=robot)
    given = {**PATIENT, "use_sim_time": True, "robot": robot}
    overrides = [Parameter(name, value=value) for name, value in given.items()]
    graph.start(SkillNode, parameter_overrides=overrides)
    try:
        assert made.action.wait_for_server(30.0)
        yield made
    finally:
        made.stop_simulator()


def place(system: TrueDoorClient, x: float) -> None:
    """Put the prototype's door so far beyond where it stands at the origin, metres."""
    values = KinematicModel.load("door").prototype
    values[0] = x
    assert system.set_simulator(placement="given", values=values.tolist()).successful
    system.start_anew()


def test_it_opens_a_door_within_its_reach(system: TrueDoorClient) -> None:
    place(system, 0.0)
    status, result = system.result(system.send(door_angle=OPENED))
    assert result.reason == ""
    assert (status, result.success) == (GoalStatus.STATUS_SUCCEEDED, True)
    system.wait_for_door(OPENED)
    names = set(system.joints[-1].name)
    assert len(names) == 8
    assert {tuple(sorted(part.joint_names)) for part in system.sent} == {tuple(sorted(names))}


def test_a_door_out_of_its_reach_is_refused_with_how_far_it_is(system: TrueDoorClient) -> None:
    place(system, 0.8)
    assert "m from the shoulder of a robot that stands" in system.fail(door_angle=OPENED)
