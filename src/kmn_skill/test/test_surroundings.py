"""The wall around a door, and that it is kept clear of."""

from __future__ import annotations

import numpy as np
import pytest
import robotic as ry
from numpy.typing import NDArray

from kmn_perception.model.kinematic_model import KinematicModel
from kmn_skill.experiments.settings import Experiment, random_recesses
from kmn_skill.planning.check import PlanRejected
from kmn_skill.planning.layout import BASE_POSITION
from kmn_skill.planning.planning_setup import PlanningSetup
from kmn_skill.planning.policy import pairs
from kmn_skill.planning.prototypes import Prototypes
from kmn_skill.planning.robot_frames import boxes
from kmn_skill.planning.solver import Solver
from kmn_skill.planning.surroundings import Obstacle, wall_around
from kmn_skill.planning.transfer import transfer
from kmn_skill.planning.world import World, blunt

MODEL = KinematicModel.load("door")
SETUP = PlanningSetup.load(MODEL)
EXPERIMENT, PROTOTYPES = Experiment.load(), Prototypes.load("door")
IN_ROOM = PlanningSetup.load(EXPERIMENT.kinematic_model(in_room=True))
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
    collisions = SETUP.robot.planning.collisions.obstacles
    kept = {pair.first for pair in pairs(world) if pair.second == "crate"}
    assert kept == {*collisions, *map(blunt, SETUP.robot.planning.collisions.blunt)}
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


@pytest.mark.parametrize("yaw", [0.0, 0.3, np.pi / 2.0])
def test_the_deeper_the_base_is_in_a_wall_the_more_it_violates_the_policy(yaw: float) -> None:
    block = Obstacle("block", np.array([1.0, 0.0, 1.0]), np.array([0.2, 4.0, 2.0]))
    world, base = World(SETUP, np.zeros(3), GAMMA, [block]), boxes(SETUP.robot)["base"]
    corners = base.centre[:2] + base.size[:2] / 2.0 * [[-1, -1], [-1, 1], [1, -1], [1, 1]]
    reach = (corners @ [np.cos(yaw), -np.sin(yaw)]).max()
    kept = [pair[:2] for pair in pairs(world) if pair.second == "block" and "base" in pair.first]

    def violation(depth: float) -> float:
        state = np.zeros(13)
        state[:3] = 0.9 - reach + depth, 0.0, yaw
        world.configuration.setJointState(state)
        distances = [-world.configuration.eval(ry.FS.negDistance, pair)[0][0] for pair in kept]
        return sum(max(SETUP.settings.policy.margin - distance, 0.0) for distance in distances)

    steps = np.diff([violation(depth) for depth in np.linspace(0.0, 0.15, 16)])
    assert steps.min() > 0.002


def test_guesses_that_lead_into_the_wall_are_led_out() -> None:
    """All but one at most: there are other first guesses after one that fails."""
    nearest = [_led_out(seed) for seed in (0, 2, 4, 6, 8, 10)]
    assert sorted(nearest)[1] > 0.0


def _led_out(seed: int) -> float:
    """Return how near base and wall come, metres, in a solution from a guess within the wall."""
    values = EXPERIMENT.random_objects(IN_ROOM.model, True, 1, seed)[0]
    recess = random_recesses("push", 1, seed)[0]
    request = EXPERIMENT.request(IN_ROOM, values, "push", recess)
    guess = transfer(
        next(PROTOTYPES.guesses(request, 1, 0.0)).solution, IN_ROOM.model, IN_ROOM.action, request
    )
    to_the_right = -IN_ROOM.model.transformation.matrix(request.theta)[:2, 1]
    opening = guess[-IN_ROOM.settings.planner.coarse :]
    opening[:, BASE_POSITION] += np.linspace(0.02, 0.1, len(opening))[:, None] * to_the_right
    solver = Solver(IN_ROOM)
    world = solver.world(request)
    assert _nearest(world, opening) < -0.019
    try:
        return _nearest(world, solver.coarse(world, request, guess))
    except PlanRejected:
        return -np.inf


def _nearest(world: World, path: NDArray[np.float64]) -> float:
    """Return how near base and wall come on a path (T, D), metres."""
    distances = []
    for positions in path:
        world.configuration.setJointState(positions)
        for name in world.obstacle_names:
            distances.append(-world.configuration.eval(ry.FS.negDistance, ["base", name])[0][0])
    return float(min(distances))


def _wall(recess: float) -> tuple[Obstacle, ...]:
    return wall_around(MODEL.body("panel"), GAMMA, recess, SETTINGS)
