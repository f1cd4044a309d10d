"""Plans keep the robot clear of wall and frame: those of the planner, measured in the simulator."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace

import numpy as np
import pytest

from kmn_perception.model.kinematic_model import KinematicModel

pytest.importorskip("pybullet")
from kmn_sim.world.scenario import Scenario, in_room  # noqa: E402
from kmn_sim.world.settings import WorldSettings  # noqa: E402
from kmn_sim.world.simulation import Simulation  # noqa: E402
from kmn_skill.experiments.settings import Experiment  # noqa: E402
from kmn_skill.planning.check import PlanRejected, check  # noqa: E402
from kmn_skill.planning.plan import Plan, PlanRequest  # noqa: E402
from kmn_skill.planning.planner import Planner  # noqa: E402
from kmn_skill.planning.planning_setup import PlanningSetup  # noqa: E402
from kmn_skill.planning.prototypes import Prototypes  # noqa: E402
from kmn_skill.planning.world import World  # noqa: E402

MODEL = KinematicModel.load("door")
SHIPPED = PlanningSetup.load(MODEL)
PATIENT = SHIPPED.settings.planner._replace(attempt_limit=100.0)  # on a busy machine
SETUP = replace(SHIPPED, settings=replace(SHIPPED.settings, planner=PATIENT))
VALUES = np.array([0.1, -0.1, 0.1, 0.0, 0.0, 0.0, 0.0])
RECESS = 0.02
AROUND = -1  # the link of the door that stands still
ROUNDING = 0.003  # metres, between the samples of the check and in pybullet's hulls


@pytest.fixture(scope="module")
def planner() -> Iterator[Planner]:
    with Planner(SETUP, Prototypes.load("door")) as planner:
        yield planner


def asked(mode: str) -> PlanRequest:
    return Experiment.load().request(SETUP, VALUES, mode, RECESS)


def nearest(plan: Plan, mode: str) -> float:
    """Return how near a robot that follows a plan comes to what stands around the door, metres."""
    scenario = in_room(Scenario(MODEL, VALUES, mode), 1, RECESS)
    with closing(Simulation(scenario, WorldSettings.load(), renderer="software")) as simulation:
        physics, robot, door = simulation.physics, simulation.robot, simulation.mechanism
        assert door is not None
        names = simulation.settings.robot.finger_names
        smallest = np.inf
        for positions, (hinge, handle) in zip(
            plan.positions[::4], plan.object_joints[::4], strict=True
        ):
            for name, position in zip(plan.joint_names, positions, strict=True):
                physics.resetJointState(robot.body, robot.link(name), position)
            for name in names:
                physics.resetJointState(robot.body, robot.link(name), positions[-1])
            physics.resetJointState(door.body, door.link("hinge"), hinge)
            physics.resetJointState(door.body, door.link("handle"), handle)
            near = physics.getClosestPoints(robot.body, door.body, 0.05, linkIndexB=AROUND)
            smallest = min([smallest, *(point[8] for point in near)])
    return smallest


@pytest.mark.parametrize("mode", ["pull", "push"])
def test_the_robot_keeps_clear_of_wall_and_frame(planner: Planner, mode: str) -> None:
    plan = planner.plan(asked(mode))
    assert nearest(plan, mode) > SETUP.settings.check.clearance - ROUNDING


def test_a_plan_that_does_not_know_of_the_wall_runs_into_it_and_is_rejected(
    planner: Planner,
) -> None:
    request = asked("push")
    plan = planner.plan(replace(request, obstacles=()))
    assert nearest(plan, "push") < 0.0
    world = World(SETUP, request.theta, request.gamma, request.obstacles)
    with pytest.raises(PlanRejected, match="comes within .* of wall_"):
        check(plan, request, world)
