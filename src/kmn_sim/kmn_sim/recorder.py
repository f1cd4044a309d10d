"""Films of a run: pictures of robot and object from beside them."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from PIL import Image

from kmn_perception.camera import Camera, look_at
from kmn_sim.scenario import Scenario
from kmn_sim.settings import DoorSettings
from kmn_sim.simulation import Simulation

FORMATS = (".gif", ".mp4")
FOCAL = 0.8  # focal length in widths of the picture
DOOR_VIEW = 4.0, -1.5, 2.2  # to the left of and along the way from robot to door, and up
DOOR_TARGET = 0.53, 0.9  # part of that way, and height
BOX_VIEW = (1.6, -2.3, 1.3), (-0.1, -0.6, 0.0)  # the same in the world; metres


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
    camera = Camera(
        width,
        height,
        FOCAL * width,
        FOCAL * width,
        (width - 1) / 2.0,
        (height - 1) / 2.0,
        _view(simulation.scenario),
    )
    return simulation.renderer.render(camera).colour


def _view(scenario: Scenario) -> NDArray[np.float64]:
    """Return the pose (4, 4) of the camera that shows what is done."""
    if not scenario.is_door:
        return look_at(*BOX_VIEW)
    start = np.array(DoorSettings.load().robot[:2])
    way = scenario.model.transformation.matrix(scenario.theta)[:2, 3] - start
    along = way / np.linalg.norm(way)
    left = np.array([-along[1], along[0]])
    target = start + DOOR_TARGET[0] * way
    position = target + DOOR_VIEW[0] * left + DOOR_VIEW[1] * along
    return look_at((*position, DOOR_VIEW[2]), (*target, DOOR_TARGET[1]))
