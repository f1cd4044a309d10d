"""Frames of doors in a folder: depth, colour and label side by side."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from kmn_perception.evaluation.doors.label import DoorLabel, FrameDescription, read_description
from kmn_perception.experiments.labelled_frame import FrameError, by_number, size_text
from kmn_perception.model.depth_image import PictureError, read_depth_image

CALIBRATED, DELIVERED, COLOUR = "_d.png", "_raw.png", "_colour.jpg"
DEPTHS = ("calibrated", "raw")


class DoorFrame(NamedTuple):
    """One frame.

    Attributes
    ----------
    name
        Of its files, without their endings.
    depth
        (height, width) metres along the optical axis, NaN where nothing was measured.
    colour
        (height, width, 3) BGR, without lens distortion, of the same pixels; None without an image.
        With depth as delivered nothing but its lens is calibrated.
    delivered
        The depth is as the sensor delivered it.
    description
        Camera and label.
    """

    name: str
    depth: NDArray[np.float32]
    colour: NDArray[np.uint8] | None
    delivered: bool
    description: FrameDescription

    @property
    def label(self) -> DoorLabel | None:
        """What is known of the door; None where none is to be found."""
        return self.description.label

    @property
    def grey(self) -> NDArray[np.float32] | None:
        """(height, width) 0 to 1; None without an image."""
        if self.colour is None:
            return None
        return cv2.cvtColor(self.colour, cv2.COLOR_BGR2GRAY).astype(np.float32) / np.float32(255.0)


class FrameFiles(NamedTuple):
    """The files of a frame, and the JSON's content; see `DoorFrame`."""

    name: str
    depth: Path
    colour: Path | None
    description: FrameDescription

    @property
    def delivered(self) -> bool:
        """Whether the depth is as the sensor delivered it."""
        return self.depth.name.endswith(DELIVERED)

    @property
    def files(self) -> list[Path]:
        """All files that there are."""
        label = self.depth.with_name(f"{self.name}.json")
        there = (self.depth, self.colour, label if label.is_file() else None)
        return [file for file in there if file is not None]

    def read(self) -> DoorFrame:
        """Read the images.

        Raises
        ------
        FrameError
            If they are no images, or not of the camera's size.
        """
        try:
            depth = read_depth_image(self.depth)
        except PictureError as error:
            raise FrameError(str(error)) from error
        self._check(self.depth, depth.shape)
        colour = self._read_colour()
        return DoorFrame(self.name, depth, colour, self.delivered, self.description)

    def _read_colour(self) -> NDArray[np.uint8] | None:
        if self.colour is None:
            return None
        colour = cv2.imread(str(self.colour), cv2.IMREAD_COLOR)
        if colour is None:
            raise FrameError(f"{self.colour} is not a picture")
        self._check(self.colour, colour.shape)
        matrix, distortion = self.description.camera.matrix, self.description.distortion
        shifted = matrix.copy()
        if not self.delivered:  # depth and colour are calibrated together
            shifted[:2, 2] += self.description.registration
        if distortion.any() or (shifted != matrix).any():
            colour = cv2.undistort(colour, matrix, distortion, None, shifted)
        return np.asarray(colour, dtype=np.uint8)

    def _check(self, file: Path, shape: Sequence[int]) -> None:
        camera = self.description.camera
        if tuple(shape[:2]) != (camera.height, camera.width):
            raise FrameError(
                f"{file.name}: {size_text(shape)} pixels, expected the {camera.width} x "
                f"{camera.height} of its intrinsics"
            )


def find_frames(folder: Path, depth: str, without_json: FrameDescription) -> list[FrameFiles]:
    """Find the frames of a folder, in the order of their numbers, and read their labels.

    Parameters
    ----------
    depth
        ``calibrated``: NAME_d.png, else NAME_raw.png; ``raw``: NAME_raw.png.
    without_json
        Of frames without a NAME.json, in which no door is to be found.

    Raises
    ------
    FrameError
        If the folder cannot be read or has no frame, or one lacks the depth image asked for.
    ConfigurationError
        If a label is wrong.
    """
    try:
        files = {file.name for file in folder.iterdir()}
    except OSError as error:
        raise FrameError(f"{folder} cannot be read: {error.strerror}") from error
    endings = (CALIBRATED, DELIVERED)
    names = {f[: -len(ending)] for f in files for ending in endings if f.endswith(ending)}
    if not names:
        raise FrameError(f"{folder} holds no file *{CALIBRATED} or *{DELIVERED}: no depth image")
    found = []
    for name in sorted(names, key=by_number):
        ending = CALIBRATED if depth == "calibrated" and name + CALIBRATED in files else DELIVERED
        if name + ending not in files:
            raise FrameError(f"{folder / name}{ending} is missing, expected with --depth raw")
        colour = folder / f"{name}{COLOUR}" if name + COLOUR in files else None
        has_json = f"{name}.json" in files
        description = read_description(folder / f"{name}.json") if has_json else without_json
        found.append(FrameFiles(name, folder / f"{name}{ending}", colour, description))
    return found
