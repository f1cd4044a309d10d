"""Depth images with labels, as `kinect_boxes` holds them."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from kmn_perception.experiments.settings import ExperimentSettings
from kmn_perception.model.camera import Camera
from kmn_perception.model.depth_image import PictureError, read_depth_image, read_picture

CAMERA_FILE = "camera.yaml"
DEPTH_SUFFIX, LABEL_SUFFIX = "_d.png", "_l.png"
TABLE, FIRST_OBJECT = 1, 2  # labels; 0 is the rest


class FrameError(ValueError):
    """A folder of frames that cannot be used; the text names the file and what was expected."""


@dataclass(frozen=True, eq=False)
class LabelledFrame:
    """One frame.

    Attributes
    ----------
    name
        Of its files, without their endings.
    depth
        (height, width) metres along the optical axis, NaN where nothing was measured.
    labels
        (height, width); 1: the table, 2 and more: one object each, 0: the rest.
    """

    name: str
    depth: NDArray[np.float32]
    labels: NDArray[np.uint8]

    def camera(self, settings: ExperimentSettings) -> Camera:
        """Return the camera that sees the experiment's view in as many pixels."""
        height, width = self.depth.shape
        return settings.camera.resized(width, height)

    @property
    def objects(self) -> list[int]:
        """The labels of the objects."""
        return [int(label) for label in np.unique(self.labels) if label >= FIRST_OBJECT]


def read_camera(folder: Path, settings: ExperimentSettings) -> Camera:
    """Return the camera of a folder's frames: of its own file, else that of the experiment.

    Raises
    ------
    ConfigurationError
        If the file is wrong.
    """
    file = folder / CAMERA_FILE
    return Camera.load(file) if file.is_file() else settings.camera


def check_frames(frames: Sequence[LabelledFrame], settings: ExperimentSettings) -> None:
    """Raise ``FrameError`` if a frame is not of the camera's shape, or shows too little table."""
    camera = settings.camera
    for frame in frames:
        height, width = frame.depth.shape
        if width * camera.height != height * camera.width:
            raise FrameError(
                f"{frame.name}: {size_text(frame.depth.shape)} pixels, expected the shape of "
                f"{camera.width} x {camera.height}, as the camera has; state that of other images "
                f"in {CAMERA_FILE} beside them (config/cameras holds examples)"
            )
        table = int(((frame.labels == TABLE) & np.isfinite(frame.depth)).sum())
        if table < settings.min_table:
            raise FrameError(
                f"{frame.name}: {table} measured pixels are labelled {TABLE}, expected a table of "
                f"{settings.min_table} or more"
            )


def read_frames(folder: Path) -> list[LabelledFrame]:
    """Read all ``NAME_d.png`` (16 bits, millimetres, 0 for none) with their ``NAME_l.png``.

    Raises
    ------
    FrameError
        If there are none, labels are missing, or a picture is not of the expected kind.
    """
    files = sorted(folder.glob(f"*{DEPTH_SUFFIX}"), key=lambda file: by_number(file.name))
    if not files:
        raise FrameError(f"{folder} holds no file *{DEPTH_SUFFIX}, expected depth images")
    return [_read_frame(file) for file in files]


def by_number(name: str) -> list[int | str]:
    """Return the key by which names are sorted with their numbers as numbers."""
    return [int(part) if part.isdecimal() else part for part in re.split(r"(\d+)", name)]


def _read_frame(file: Path) -> LabelledFrame:
    name = file.name[: -len(DEPTH_SUFFIX)]
    try:
        depth = read_depth_image(file)
        labels = read_picture(file.with_name(name + LABEL_SUFFIX), np.uint8)
    except PictureError as error:
        raise FrameError(str(error)) from error
    if labels.shape != depth.shape:
        raise FrameError(
            f"{name}: labels of {size_text(labels.shape)} pixels for a depth image of "
            f"{size_text(depth.shape)}; expected the same size"
        )
    return LabelledFrame(name, depth, labels)


def size_text(shape: Sequence[int]) -> str:
    """Return the size of an image (height, width, ...) for people."""
    return f"{shape[1]} x {shape[0]}"
