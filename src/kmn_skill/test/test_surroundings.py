"""The wall around a door, and that it is kept clear of."""

from __future__ import annotations

import numpy as np
import pytest
import robotic as ry

from kmn_perception.model.kinematic_model import KinematicModel
from kmn_skill.planning.planning_setup import PlanningSetup
from kmn_skill.planning.policy import pairs
from kmn_skill.planning.surroundings import Obstacle, wall_around
from kmn_skill.planning.world import World

MODEL = KinematicModel.load("door")
SETUP = PlanningSetup.load(MODEL)
GAMMA = np.array([-0.2, 0.1, 0.0, 0.0])
SETTINGS = SETUP.settings.surroundings


@pytest.mark.parametrize("recess", [0.0, 0.1])
def test_the_wall_leaves_the_opening_free_and_reaches_before_the_panel(recess: float) -> None:
    wall = {o.name: (o.centre - o.size / 2.0, o.centre + o.size / 2.0) for o in _wall(recess)}
    panel = MODEL.body("panel")
    low, high = panel.centre(GAMMA) - panel.size(GAMMA) / 2.0, panel.size(GAMMA)
    for corner, _ in wall.values():
        assert corner[0] == pytest.approx(low[0] - recess - SETTINGS.frame_proud)
    gap = SETTINGS.gap
    assert wall["wall_left"][0][1] == pytest.approx(-low[1] + gap)
    assert wall["wall_right"][1][1] == pytest.approx(low[1] - gap)
    assert wall["wall_above"][0][2] == pytest.approx(high[2] + gap)
    for name in ("wall_left", "wall_right"):
        assert wall[name][0][2] == pytest.approx(0.0)
        assert wall[name][1][2] == pytest.approx(wall["wall_above"][1][2])
        assert wall[name][1][2] >= SETTINGS.height


def test_any_cuboid_is_an_obstacle_where_the_object_stands() -> None:
    theta = np.array([0.3, -0.2, 0.5])
    crate = Obstacle("crate", np.array([-0.5, 1.0, 0.2]), np.array([0.4, 0.3, 0.4]))
    world = World(SETUP, theta, GAMMA, [crate])
    frame = world.configuration.getFrame("crate")
    expected = MODEL.transformation.matrix(theta) @ [*crate.centre, 1.0]
    assert frame.getPosition() == pytest.approx(expected[:3])
    collisions = SETUP.settings.policy.obstacle_collisions
    kept = {pair.first for pair in pairs(world) if pair.second == "crate"}
    assert kept == set(collisions)
    assert set(collisions) <= set(SETUP.robot.planning.bodies)
    # The base a hand's breadth beside the crate.
    yaw, place = theta[2], expected[:2]
    half = world.configuration.getFrame("base").getSize()[0] / 2.0
    away = place - (half + 0.2 + 0.1) * np.array([np.cos(yaw), np.sin(yaw)])
    state = np.zeros(13)
    state[:3] = *away, yaw
    world.configuration.setJointState(state)
    distance = -world.configuration.eval(ry.FS.negDistance, ["base", "crate"])[0][0]
    assert distance == pytest.approx(0.1, abs=0.05)


def _wall(recess: float) -> tuple[Obstacle, ...]:
    return wall_around(MODEL, GAMMA, recess, SETTINGS)
