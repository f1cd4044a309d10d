"""A door in a simulated room is perceived well enough to grasp its handle, by depth and image."""

from __future__ import annotations

from contextlib import closing

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from kmn_perception.doors.door_estimate import DoorEstimate, DoorStatus
from kmn_perception.doors.door_finder import DoorFinder
from kmn_perception.doors.walls import Frame
from kmn_perception.model.depth_sensor import DepthSensor
from kmn_perception.model.noisy_sensor import NoisySensor

pytest.importorskip("pybullet")
from kmn_sim.sensors.depth_camera import DepthCamera  # noqa: E402
from kmn_sim.world.scenario import Scenario, in_room  # noqa: E402
from kmn_sim.world.settings import WorldSettings  # noqa: E402
from kmn_sim.world.simulation import Simulation  # noqa: E402
from kmn_skill.experiments.settings import Experiment, random_recesses  # noqa: E402

EXPERIMENT = Experiment.load()
MODEL = EXPERIMENT.kinematic_model(in_room=True)
GRASP = 0.02  # metres that the gripper forgives
VERTICAL = 8e-4  # radians, by which a handle at 2 m is 1.6 mm too high or too low


def perceive(
    values: NDArray[np.float64], direction: str, seed: int, recess: float | None = None
) -> DoorEstimate:
    """Return what is seen of a simulated door from where the robot starts."""
    scenario = in_room(Scenario(MODEL, values, direction), seed, recess)
    sensor = NoisySensor(DepthSensor.load("kinect_v1"), seed)
    with closing(Simulation(scenario, WorldSettings.load(), renderer="software")) as simulation:
        picture = DepthCamera(MODEL.camera, "world", sensor).expose(simulation)
    grey = cv2.cvtColor(picture.colour, cv2.COLOR_RGB2GRAY).astype(np.float32) / 255.0
    depth, camera = np.nan_to_num(picture.depth), MODEL.camera
    up, height = camera.pose[2, :3].copy(), float(camera.pose[2, 3])
    return DoorFinder.load().find(Frame(depth, grey, camera, up, height))


@pytest.mark.parametrize("number", [10, 62, 82])
def test_a_lever_that_is_seen_before_the_reveal_is_no_knob(number: int) -> None:
    """Before the dark reveal beside the panel it is clearest; its length is seen on the panel."""
    values = EXPERIMENT.random_objects(MODEL, True, number + 1, 1)[number]
    found = perceive(values, "pull", number + 1)
    assert found.status is DoorStatus.OK, found.reason
    assert found.handle_kind == "lever"


@pytest.mark.parametrize("number", [22, 35, 42])
def test_a_lever_as_bright_as_its_panel_that_reaches_before_the_reveal_is_no_knob(
    number: int,
) -> None:
    """All of it is equally bright, though it shows clearly before the reveal alone."""
    values = EXPERIMENT.random_objects(MODEL, True, 50, 41)[number]
    recess = random_recesses("push", 50, 41)[number]
    found = perceive(values, "push", 41 + number, recess)
    assert found.status is DoorStatus.OK, found.reason
    assert found.handle_kind == "lever"


@pytest.mark.parametrize(
    ("direction", "seed"), [("pull", 2), ("pull", 6), ("push", 0), ("push", 3)]
)
def test_the_handle_and_the_edges_are_where_they_stand(direction: str, seed: int) -> None:
    values = EXPERIMENT.random_objects(MODEL, True, 1, seed)[0]
    found = perceive(values, direction, seed)
    assert found.status is DoorStatus.OK, found.reason
    assert (found.handle_kind, found.handle_side) == ("lever", "right")
    theta, gamma = MODEL.split(values)
    to_camera = MODEL.camera.world_to_camera @ MODEL.transformation.matrix(theta)
    handle = to_camera @ [*MODEL.body("handle").centre(gamma), 1.0]
    np.testing.assert_allclose(found.handle, handle[:3], atol=GRASP)
    panel = MODEL.body("panel")
    front, half = panel.centre(gamma)[0] - panel.size(gamma)[0] / 2.0, panel.size(gamma)[1] / 2.0
    for corner, y in zip(found.corners[2:], (half, -half), strict=True):  # on the floor
        np.testing.assert_allclose(corner, (to_camera @ [front, y, 0.0, 1.0])[:3], atol=GRASP)


@pytest.mark.parametrize("seed", [1, 5, 8])
def test_the_vertical_is_seen_as_it_is(seed: int) -> None:
    """By long lines more than by short ones, in an image without the steps of sampled pixels."""
    values = EXPERIMENT.random_objects(MODEL, True, 1, seed)[0]
    found = perceive(values, "pull", seed)
    up, seen = MODEL.camera.pose[2, :3], found.camera_pose[2, :3]
    assert np.arccos(up @ seen / np.linalg.norm(up) / np.linalg.norm(seen)) < VERTICAL
