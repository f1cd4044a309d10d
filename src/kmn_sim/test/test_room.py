"""The room around a door: where it is, that the door swings free, that it stops a robot."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.model.rendering import render
from kmn_sim.control.trajectory import Command, Waypoint
from kmn_sim.robot.settings import RobotSettings
from kmn_sim.sensors.depth_camera import DepthCamera
from kmn_sim.world.room import Room, Way
from kmn_sim.world.room_settings import RoomSettings
from kmn_sim.world.scenario import Scenario, ScenarioError, in_room
from kmn_sim.world.simulation import Simulation

Simulate = Callable[..., Simulation]
MODEL = KinematicModel.load("door")
AROUND = -1  # the link of the door that stands still
SWINGS = {"pull": -1.57, "push": 1.57}


def room(simulate: Simulate, direction: str, seed: int, recess: float | None = None) -> Simulation:
    values = MODEL.sample(np.random.default_rng(seed), 1)[0]
    simulation = simulate(values=values, direction=direction, renderer="software")
    simulation.build(in_room(simulation.scenario, seed, recess))
    return simulation


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("direction", SWINGS)
def test_the_panel_swings_free_of_its_frame(simulate: Simulate, direction: str, seed: int) -> None:
    deepest = getattr(RoomSettings.load().recess, direction)[1]
    for recess in (0.0, deepest):
        simulation = room(simulate, direction, seed, recess)
        physics, door = simulation.physics, simulation.mechanism
        assert door is not None
        for angle in np.linspace(0.0, SWINGS[direction], 40):
            physics.resetJointState(door.body, door.link("hinge"), angle)
            for point in physics.getClosestPoints(
                door.body, door.body, 0.1, door.link("hinge"), AROUND
            ):
                assert point[8] > 0.001, angle


@pytest.mark.parametrize("direction", SWINGS)
def test_the_recess_is_that_of_the_panel_behind_the_wall(
    simulate: Simulate, direction: str
) -> None:
    simulation = room(simulate, direction, 4, 0.1)
    drawn = simulation.scenario.room
    assert drawn is not None
    camera = MODEL.camera
    depth = render(simulation.unit_cubes(), camera)
    v, u = np.nonzero(np.isfinite(depth))
    z = depth[v, u]
    rays = np.stack([(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, np.ones(len(u))])
    points = camera.pose[:3, :3] @ (rays * z) + camera.pose[:3, 3:]
    pose = np.linalg.inv(MODEL.transformation.matrix(simulation.scenario.theta))
    x, y, up = pose[:3, :3] @ points + pose[:3, 3:]
    panel = MODEL.body("panel")
    width, height = panel.size(simulation.scenario.gamma)[1:]
    front = -panel.size(simulation.scenario.gamma)[0] / 2.0
    middle = (abs(y) < width / 2.0 - 0.2) & (up > 0.3) & (up < height - 0.3)
    assert np.median(x[middle]) == pytest.approx(front, abs=1e-3)
    above = (abs(y) < width / 2.0) & (up > height + 0.15)
    assert np.median(x[above]) == pytest.approx(front - 0.1, abs=1e-3)
    lintel = (abs(y) < width / 2.0) & (up > height + 0.01) & (up < height + 0.04)
    assert np.median(x[lintel]) == pytest.approx(front - 0.1 - drawn.frame_proud, abs=1e-3)


@pytest.mark.parametrize("direction", SWINGS)
def test_the_wall_stops_the_robot(simulate: Simulate, direction: str) -> None:
    simulation = simulate(direction=direction, renderer="software")
    simulation.build(in_room(simulation.scenario, 0))
    names = RobotSettings.load().base_names
    aside = Command(names, [Waypoint(3.0, (-1.0, -1.2, 0.0)), Waypoint(5.0, (0.5, -1.2, 0.0))])
    simulation.controllers.accept(aside, simulation.time)
    simulation.run(5.0)
    assert simulation.mechanism is not None
    bodies = simulation.robot.body, simulation.mechanism.body
    touched = simulation.physics.getContactPoints(*bodies)
    assert any(point[4] == AROUND for point in touched)
    assert simulation.robot.base_pose()[0, 3] < -0.2


def test_furniture_is_never_in_the_way_of_robot_and_door() -> None:
    settings, home = RoomSettings.load(), RobotSettings.load()
    start = np.array([home.home[name] for name in home.base_names[:2]])
    stood = 0
    for seed in range(200):
        values = MODEL.sample(np.random.default_rng(seed), 1)[0]
        for direction in SWINGS:
            way = Way.of(MODEL, MODEL.actions[0], values, (start[0], start[1]))
            drawn = Room.draw(settings, direction, seed, way)
            if drawn.furniture is None:
                continue
            stood += 1
            theta, gamma = MODEL.split(values)
            pose = np.linalg.inv(MODEL.transformation.matrix(theta))
            begin = pose[:2, :2] @ start + pose[:2, 3]
            width = MODEL.body("panel").size(gamma)[1]
            piece = drawn.furniture
            assert piece.side == np.sign(MODEL.joints[0].origin(gamma)[1])
            edge = width / 2.0 + drawn.frame_width + piece.distance
            # A door that is open by 90 degrees stands on the hinge's side, within its frame.
            assert edge > width / 2.0 + 0.1
            nearest = np.array([0.0, piece.side * edge])
            for along in np.linspace(begin, MODEL.body("handle").centre(gamma)[:2], 20):
                beside = np.clip(along[0], -piece.size[0], 0.0), nearest[1]
                if piece.side * along[1] > edge:
                    beside = beside[0], along[1]
                assert np.linalg.norm(along - beside) > settings.furniture.clear - 0.05
    assert stood > 200


def test_the_same_seed_draws_the_same_room_and_others_differ() -> None:
    scenario = Scenario(MODEL, np.zeros(7))
    rooms = [in_room(scenario, seed).room for seed in (1, 1, 2)]
    assert rooms[0] == rooms[1] != rooms[2]
    given = in_room(scenario, 1, 0.013).room
    assert given is not None and rooms[0] is not None
    assert (given.recess, given.poster) == (0.013, rooms[0].poster)


@pytest.mark.parametrize("direction", SWINGS)
def test_depth_in_a_room_is_that_of_exact_ray_casting(simulate: Simulate, direction: str) -> None:
    simulation = room(simulate, direction, 3)
    exact = render(simulation.unit_cubes(), MODEL.camera)
    error = np.abs(DepthCamera(MODEL.camera).capture(simulation) - exact)
    assert np.nanpercentile(error, 98.0) < 1e-3  # but for edges


@pytest.mark.parametrize("renderer", ["egl", "software"])
def test_the_colours_are_registered_to_the_depth(simulate: Simulate, renderer: str) -> None:
    simulation = simulate(renderer=renderer)
    simulation.build(in_room(simulation.scenario, 5))
    camera = MODEL.camera
    colour = DepthCamera(camera).expose(simulation).colour.astype(int)
    _, handle = MODEL.unit_cubes(np.zeros(3), np.zeros(4))
    true = np.isfinite(render(handle[None], camera))
    rows, columns = np.nonzero(true)
    window = np.s_[rows.min() - 3 : rows.max() + 4, columns.min() - 3 : columns.max() + 4]
    # The handle is grey on a panel of another colour.
    part, mask = colour[window], true[window]
    background = np.median(part[~mask], axis=0)
    seen = np.abs(part - background).sum(axis=-1) > 40
    for axis in (0, 1):
        found, expected = (np.flatnonzero(m.any(axis=axis))[[0, -1]] for m in (seen, mask))
        np.testing.assert_allclose(found, expected, atol=1)


@pytest.mark.parametrize(
    ("model", "options", "text"),
    [
        ("box_a", {}, "'room' is for doors"),
        ("door", {"frame": True}, "a 'room' has its own frame and wall"),
        ("door", {"wall": True}, "a 'room' has its own frame and wall"),
    ],
)
def test_a_room_that_cannot_be_is_refused(model: str, options: dict[str, Any], text: str) -> None:
    kinematic = KinematicModel.load(model)
    scenario = Scenario(kinematic, np.zeros(len(kinematic.parameters)), **options)
    with pytest.raises(ScenarioError, match=text):
        in_room(scenario, 0)
