"""Objects of other kinds than doors: what the planner and the skill make of their files alone."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml
from numpy.typing import NDArray

from kmn_perception.configuration import resources
from kmn_perception.configuration.section import ConfigurationError
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_skill.execution.door_observation import when_closed
from kmn_skill.execution.errors import ExecutionError, GoalError
from kmn_skill.execution.goal import Goal
from kmn_skill.execution.goal_check import check_goal, check_reached
from kmn_skill.execution.grasp_quantities import swung
from kmn_skill.execution.held_door import GripSettings, HeldDoor
from kmn_skill.experiments.settings import chosen_mode
from kmn_skill.planning.plan import PlanningFailed, PlanRequest
from kmn_skill.planning.planner import Planner
from kmn_skill.planning.planning_setup import NO_LATCH, PlanningSetup
from kmn_skill.planning.prototypes import Prototypes
from kmn_skill.planning.world import CONTACTS, GRASP, World, object_body

OBJECTS = ("drawer", "cupboard_door", "fridge", "lid")
ROBOTS = ("pr2", "panda_ranger")
DRAWER = KinematicModel.load("drawer")
(OPEN,) = DRAWER.actions
VALUES = np.array([0.2, -0.1, 0.3, 0.1, -0.1, 0.05, 0.02, -0.01])


@pytest.mark.parametrize("name", OBJECTS)
def test_bodies_and_contacts_move_as_the_model_has_it(name: str) -> None:
    """The solver's kinematics against the model's own."""
    model = KinematicModel.load(name)
    setup, (action,) = PlanningSetup.load(model), model.actions
    values = 0.7 * model.limits[:, 0]
    theta, gamma = model.split(values)
    world = World(setup, theta, gamma)
    assert world.joint_names[-2:] == (action.joint.name, NO_LATCH)
    configuration = np.array([*setup.robot.home, action.target, 0.0])
    frames = [object_body(body.name) for body in model.bodies]
    poses = world.poses(configuration[None], [*frames, GRASP, *CONTACTS])[0]
    positions = {action.joint.name: action.target}
    cubes = model.moved_cubes(values, positions)
    for pose, cube, body in zip(poses, cubes, model.bodies, strict=False):
        np.testing.assert_allclose(pose[:3, :3] * body.size(gamma), cube[:3, :3], atol=1e-9)
        np.testing.assert_allclose(pose[:3, 3], cube[:3, 3], atol=1e-9)
    grasp, first, second = poses[len(frames) :]
    across = first[:3, 3] - second[:3, 3]
    assert np.linalg.norm(across) == pytest.approx(action.grasp.thickness(gamma))
    np.testing.assert_allclose(across / np.linalg.norm(across), grasp[:3, 2], atol=1e-9)
    np.testing.assert_allclose((first + second)[:3, 3] / 2.0, grasp[:3, 3], atol=1e-9)


def test_a_round_bar_is_kept_clear_of_as_the_cuboid_that_holds_it(tmp_path: Path) -> None:
    content = yaml.safe_load(resources.find("config/models", "cupboard_door").read_text())
    bar = {"shape": "cylinder", "axis": "z", "radius": 0.012, "length": 0.16}
    content["bodies"]["bar"] = bar | {"centre": content["bodies"]["bar"]["centre"]}
    (tmp_path / "round.yaml").write_text(yaml.safe_dump(content, sort_keys=False))
    model = KinematicModel.load(tmp_path / "round.yaml")
    setup = PlanningSetup.load(model)
    world = World(setup, *model.split(model.prototype))
    np.testing.assert_allclose(world.object_boxes()["bar"].size, [0.024, 0.024, 0.16])
    contacts = world.poses(np.array([[*setup.robot.home, 0.0, 0.0]]), list(CONTACTS))[0]
    assert np.linalg.norm(np.subtract(*contacts[:, :3, 3])) == pytest.approx(0.024)


@pytest.mark.parametrize("robot", ROBOTS)
@pytest.mark.parametrize("name", OBJECTS)
def test_motions_are_those_of_the_object_s_joints(name: str, robot: str) -> None:
    model = KinematicModel.load(name)
    setup = PlanningSetup.load(model, robot)
    known = Prototypes.load(setup.action.motions, robot)
    assert known.joints == setup.joint_names
    (solution,) = known.solutions["pull"]
    assert not known.solutions["push"]
    assert solution.path[-1, -2:] == pytest.approx([setup.action.target, 0.0], abs=1e-3)


@pytest.fixture(scope="module")
def planner() -> Iterator[Planner]:
    setup = PlanningSetup.load(DRAWER)
    with Planner(setup, Prototypes.load(setup.action.motions)) as made:
        yield made


def request(target: float) -> PlanRequest:
    home = PlanningSetup.load(DRAWER).robot.home
    return PlanRequest(*DRAWER.split(VALUES), home, np.zeros(2), 0.0, target)


def test_a_drawer_is_planned_for_straight_along_its_slide(planner: Planner) -> None:
    plan = planner.plan(request(-0.25))
    assert plan.object_joints[-1] == pytest.approx([-0.25, 0.0], abs=1e-3)
    assert plan.report.contact_error < 1e-3
    pads = np.array(
        [planner.pads(plan.positions[i]).mean(axis=0) for i in (plan.phase("open").first, -1)]
    )
    yaw = VALUES[2]
    slide = -0.25 * np.array([np.cos(yaw), np.sin(yaw), 0.0])
    np.testing.assert_allclose(pads[1] - pads[0], slide, atol=2e-3)


def test_a_side_to_which_no_motion_is_known_is_said(planner: Planner) -> None:
    with pytest.raises(PlanningFailed, match="no motion is known that moves it to this side"):
        planner.plan(request(0.2))


def test_the_hand_tells_how_far_a_drawer_is_out() -> None:
    theta, gamma = DRAWER.split(VALUES)
    pose = DRAWER.transformation.matrix(theta)
    across = np.array([0.0, 0.0, 0.5 * OPEN.grasp.thickness(gamma)])
    grasped = np.array([OPEN.grasp.place(gamma) + across, OPEN.grasp.place(gamma) - across])
    at: NDArray[np.float64] = grasped @ pose[:3, :3].T + pose[:3, 3]
    fingers = {"pads": at}
    held = HeldDoor(DRAWER, OPEN, lambda _: fingers["pads"], 0.0255, GripSettings(0.5, 0.02))
    held.see(VALUES, 0.0)
    held.grasp(np.zeros(11), np.zeros(2))
    fingers["pads"] = at - 0.2 * pose[:3, 0]
    assert held.angles(np.zeros(11)) == pytest.approx((-0.2, 0.0), abs=1e-6)


def test_a_drawer_seen_half_out_is_shut_again() -> None:
    """Perception takes it for a closed one that stands nearer."""
    shut = when_closed(DRAWER, when_closed(DRAWER, VALUES, 0.15), -0.15)
    np.testing.assert_allclose(shut, VALUES, atol=1e-9)
    assert swung(DRAWER, VALUES, when_closed(DRAWER, VALUES, 0.15)) == pytest.approx(-0.15)


def test_how_far_a_lid_is_open_no_parameter_tells() -> None:
    lid = KinematicModel.load("lid")
    moved = lid.prototype + [0.01, 0.0, 0.02, 0.0, 0.0, 0.0]
    assert swung(lid, lid.prototype, moved) == 0.0


def test_goals_are_in_the_joint_s_unit() -> None:
    check_goal(Goal(0.0, -0.3), OPEN, 0.03)
    with pytest.raises(
        GoalError, match=r"-0.5 is beyond the joint 'slide', expected \[-0.4, 0\] m"
    ):
        check_goal(Goal(0.0, -0.5), OPEN, 0.03)
    with pytest.raises(GoalError, match="there is no such thing: expected 0"):
        check_goal(Goal(-0.7, -0.3), OPEN, 0.03)
    with pytest.raises(ExecutionError, match="the slide came to -0.20 m, expected -0.30 m"):
        check_reached(Goal(0.0, -0.2), Goal(0.0, -0.3), OPEN, (0.1, 0.03))


def test_the_side_follows_from_the_target() -> None:
    """A joint may count either way; which way it is opened says its target, unless one asks."""
    assert chosen_mode(OPEN, "") == "pull"
    other = replace(OPEN, target=0.3, joint=replace(OPEN.joint, limits=(0.0, 0.4)))
    assert chosen_mode(other, "") == "push"
    with pytest.raises(ConfigurationError, match="'slide' does not open by pull, but by push"):
        chosen_mode(other, "pull")
    (door,) = KinematicModel.load("door").actions
    assert (chosen_mode(door, ""), chosen_mode(door, "push")) == ("pull", "push")
