"""Films of a run: pictures of robot and object from beside them."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from PIL import Image

from kmn_perception.model.camera import Camera, look_at
from kmn_sim.world.scenario import Scenario
from kmn_sim.world.settings import DoorMechanics, RecordingSettings
from kmn_sim.world.simulation import Simulation

FORMATS = (".gif", ".mp4")


class Recorder:
    """Takes pictures of a simulation and writes a film of them.

    Parameters
    ----------
    file
        Path with one of the endings ``FORMATS``.
    rate
        Pictures a second.
    """

    def __init__(self, file: Path, rate: float, width: int = 640, height: int = 480) -> None:
        self._file, self._rate, self._size = file, rate, (width, height)
        self._pictures: list[Image.Image] = []
        self._video: cv2.VideoWriter | None = None
        if file.suffix == ".mp4":
            code = cv2.VideoWriter.fourcc(*"mp4v")
            self._video = cv2.VideoWriter(str(file), code, rate, self._size)

    def take(self, simulation: Simulation) -> None:
        """Add a picture of the present."""
        picture = snapshot(simulation, *self._size)
        if self._video is not None:
            self._video.write(np.ascontiguousarray(picture[..., ::-1]))
        else:
            self._pictures.append(Image.fromarray(picture).quantize(64))

    def close(self) -> None:
        """Write the film."""
        if self._video is not None:
            self._video.release()
        elif self._pictures:
            first, *others = self._pictures
            first.save(
                self._file,
                save_all=True,
                append_images=others,
                duration=round(1e3 / self._rate),
                loop=0,
            )


def snapshot(simulation: Simulation, width: int, height: int) -> NDArray[np.uint8]:
    """Return a picture (height, width, 3) of robot and object, from beside them."""
    settings = RecordingSettings.load()
    focal_length, pose = settings.focal_length * width, _view(simulation.scenario, settings)
    centre = (width - 1) / 2.0, (height - 1) / 2.0
    camera = Camera(width, height, focal_length, focal_length, *centre, pose)
    return simulation.renderer.render(camera).colour


def _view(scenario: Scenario, settings: RecordingSettings) -> NDArray[np.float64]:
    """Return the pose (4, 4) of the camera that shows what is done."""
    if not scenario.is_door:
        return look_at(settings.box_position, settings.box_target)
    start = np.array(DoorMechanics.load().robot[:2])
    way = scenario.model.transformation.matrix(scenario.theta)[:2, 3] - start
    along = way / np.linalg.norm(way)
    left = np.array([-along[1], along[0]])
    target = start + settings.target * way
    position = target + settings.left * left + settings.along * along
    return look_at((*position, settings.height), (*target, settings.target_height))
