"""A robot that stands where it is: it opens a door within its reach, and refuses the others."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import yaml
from fixed_robot import PANDA, STANDS, write_robot
from numpy.typing import NDArray

from kmn_perception.configuration.section import ConfigurationError
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_skill.planning.layout import BASE
from kmn_skill.planning.plan import PlanningFailed, PlanRequest
from kmn_skill.planning.planner import Planner
from kmn_skill.planning.planning_setup import PlanningSetup
from kmn_skill.planning.prototypes import Prototypes
from kmn_skill.planning.robot import RobotModel

DOOR = KinematicModel.load("door")


@pytest.fixture(scope="module")
def setup(tmp_path_factory: pytest.TempPathFactory) -> PlanningSetup:
    return PlanningSetup.load(DOOR, write_robot(tmp_path_factory.mktemp("robot")))


@pytest.fixture(scope="module")
def planner(setup: PlanningSetup) -> Iterator[Planner]:
    with Planner(setup, Prototypes.load("door", PANDA)) as made:
        yield made


def request(
    setup: PlanningSetup, values: NDArray[np.float64] = DOOR.prototype, angle: float = -0.5
) -> PlanRequest:
    theta, gamma = DOOR.split(values)
    return PlanRequest(theta, gamma, setup.robot.home, np.zeros(2), -0.7, angle)


def test_its_base_has_no_joints_in_messages(setup: PlanningSetup) -> None:
    assert setup.robot.told_names == setup.robot.joint_names[BASE.stop :]
    assert tuple(setup.robot.home[BASE]) == STANDS


def test_it_opens_a_door_within_its_reach_and_stands(
    setup: PlanningSetup, planner: Planner
) -> None:
    plan = planner.plan(request(setup))
    assert np.ptp(plan.positions[:, BASE], axis=0).max() == 0.0
    assert not plan.velocities[:, BASE].any()
    assert plan.report.contact_error < 1e-3
    assert plan.report.opened == pytest.approx(-0.5, abs=0.01)


def test_a_door_out_of_reach_is_refused_with_how_far_it_is(
    setup: PlanningSetup, planner: Planner
) -> None:
    far = DOOR.prototype.copy()
    far[0] += 1.0
    with pytest.raises(PlanningFailed, match="the handle is 1.55 m from the shoulder .* m long"):
        planner.plan(request(setup, far))


def test_it_does_not_drive_to_see_a_handle(setup: PlanningSetup, planner: Planner) -> None:
    with pytest.raises(PlanningFailed, match="its base cannot drive elsewhere"):
        planner.look(DOOR.prototype, setup.robot.home, setup.robot.home, 0.3)


def test_a_fixed_base_has_no_controller(tmp_path: Path) -> None:
    file = write_robot(tmp_path)
    values = yaml.safe_load(file.read_text())
    values["controllers"]["arm"]["joints"].append("base_x")
    file.write_text(yaml.safe_dump(values, sort_keys=False))
    with pytest.raises(ConfigurationError, match="controllers: a fixed base has none, found"):
        RobotModel.load(file)
