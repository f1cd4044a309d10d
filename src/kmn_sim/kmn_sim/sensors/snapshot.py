"""Pictures of a run, taken from beside robot and object."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from kmn_perception.model.camera import Camera, look_at
from kmn_sim.sensors.settings import PictureSize, RecordingSettings
from kmn_sim.world.simulation import Simulation


def snapshot(
    simulation: Simulation, settings: RecordingSettings, size: PictureSize
) -> NDArray[np.uint8]:
    """Return a picture (height, width, 3) of robot and object, from beside them."""
    width, height = size
    focal_length = settings.focal_length * width
    centre = (width - 1) / 2.0, (height - 1) / 2.0
    camera = Camera(width, height, focal_length, focal_length, *centre, _view(simulation, settings))
    return simulation.renderer.render(camera).colour


def _view(simulation: Simulation, settings: RecordingSettings) -> NDArray[np.float64]:
    """Return the pose (4, 4) of the camera that shows what is done."""
    scenario, robot, view = simulation.scenario, simulation.settings.robot, settings.door
    if not scenario.is_articulated:
        return look_at(settings.box.position, settings.box.target)
    x, y, _ = robot.base_names
    start = np.array([robot.home[x], robot.home[y]])
    way = scenario.model.transformation.matrix(scenario.theta)[:2, 3] - start
    along = way / np.linalg.norm(way)
    left = np.array([-along[1], along[0]])
    target = start + view.target * way
    position = target + view.left * left + view.along * along
    return look_at((*position, view.height), (*target, view.target_height))
