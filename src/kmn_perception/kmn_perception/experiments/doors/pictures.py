"""Pictures of doors that were found, with their labels, over what was seen."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from kmn_perception.configuration.output import replacing
from kmn_perception.doors.door_estimate import DoorStatus
from kmn_perception.experiments.doors.experiment import WITH_COLOUR, DoorResult
from kmn_perception.experiments.doors.frames import DoorFrame
from kmn_perception.model.camera import Camera

Picture = NDArray[np.uint8]

# Blue, green, red.
COLOURS = {
    DoorStatus.OK: (107, 214, 47),
    DoorStatus.HANDLE_NOT_SEEN: (66, 197, 245),
    DoorStatus.AMBIGUOUS: (60, 96, 240),
    DoorStatus.NO_DOOR: (60, 96, 240),
}
WHITE, BLACK, WRONG = (255, 255, 255), (0, 0, 0), (255, 0, 255)
SCALE = 2  # of the picture
SHIFT = 4  # bits of the fractions of a pixel in which OpenCV draws
COLUMNS, WIDTH = 6, 320  # of the overview: pictures in a row, and pixels of each
RADIUS = 0.03  # of the circle at a handle, metres
EDGES = ((0, 1), (0, 2), (1, 3), (2, 3))  # of the corners of an estimate


class Pictures:
    """Writes a picture for each frame into a folder, which is made, and one of all."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._small: list[Picture] = []
        folder.mkdir(parents=True, exist_ok=True)

    def add(self, frame: DoorFrame, result: DoorResult) -> None:
        """Write the picture of a frame, with the estimate from depth and colour."""
        picture = _draw(frame, result)
        _write(self.folder / f"{frame.name}.png", picture)
        height = round(WIDTH * picture.shape[0] / picture.shape[1])
        resized = cv2.resize(picture, (WIDTH, height), interpolation=cv2.INTER_AREA)
        self._small.append(np.asarray(resized, dtype=np.uint8))

    def save_all(self) -> Path:
        """Write the picture of all frames, and return its path."""
        sheet = self.folder / "all_frames.png"
        _write(sheet, _side_by_side(self._small))
        return sheet


def _side_by_side(pictures: Sequence[Picture]) -> Picture:
    """Return all pictures in rows."""
    height = max(picture.shape[0] for picture in pictures)
    rows = math.ceil(len(pictures) / COLUMNS)
    sheet = np.zeros((rows * height, min(len(pictures), COLUMNS) * WIDTH, 3), np.uint8)
    for i, picture in enumerate(pictures):
        top, left = i // COLUMNS * height, i % COLUMNS * WIDTH
        sheet[top : top + picture.shape[0], left : left + WIDTH] = picture
    return sheet


def _draw(frame: DoorFrame, result: DoorResult) -> Picture:
    estimate = result.estimates[WITH_COLOUR]
    picture = _background(frame)
    camera = replace(frame.description.camera, pose=np.eye(4))
    wrong = result.outcomes[WITH_COLOUR].wrong
    colour = WRONG if wrong else COLOURS[estimate.status]
    if np.isfinite(estimate.corners).all():
        for a, b in EDGES:
            _line(picture, camera, estimate.corners[a], estimate.corners[b], colour, 3)
        if estimate.handle_side:
            _circle(picture, camera, estimate.handle, colour, 3)
    label = frame.label
    if label is not None:
        for edge in label.edges:
            if edge is not None:
                _line(picture, camera, edge.top, edge.bottom, WHITE, 1)
        if label.handle is not None:
            _circle(picture, camera, label.handle, WHITE, 1)
    title = f"{frame.name}: {estimate.status.value}{', wrong' if wrong else ''}"
    for thickness, ink in ((9, BLACK), (3, colour)):
        cv2.putText(
            picture, title, (14, 54), cv2.FONT_HERSHEY_SIMPLEX, 1.6, ink, thickness, cv2.LINE_AA
        )
    return picture


def _background(frame: DoorFrame) -> Picture:
    """Return the colour image, or the depth in colours."""
    image = frame.colour
    if image is None:
        inverse = np.nan_to_num(1.0 / frame.depth, posinf=0.0)
        shade = np.rint(255.0 * inverse / max(float(inverse.max()), 1e-9)).astype(np.uint8)
        image = np.asarray(cv2.applyColorMap(shade, cv2.COLORMAP_VIRIDIS), dtype=np.uint8)
    size = (SCALE * image.shape[1], SCALE * image.shape[0])
    return np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_LINEAR), dtype=np.uint8)


def _pixel(camera: Camera, point: NDArray[np.float64]) -> tuple[int, int]:
    """Return where a point is drawn, in fractions of the picture's pixels."""
    u, v, _ = SCALE * (camera.project(point) + 0.5) - 0.5
    return round(float(u) * 2**SHIFT), round(float(v) * 2**SHIFT)


def _line(
    picture: Picture,
    camera: Camera,
    a: NDArray[np.float64],
    b: NDArray[np.float64],
    colour: Sequence[int],
    thickness: int,
) -> None:
    if min(a[2], b[2]) > camera.near:
        ends = _pixel(camera, a), _pixel(camera, b)
        cv2.line(picture, *ends, colour, thickness, cv2.LINE_AA, SHIFT)


def _circle(
    picture: Picture,
    camera: Camera,
    centre: NDArray[np.float64],
    colour: Sequence[int],
    thickness: int,
) -> None:
    if centre[2] > camera.near:
        radius = round(SCALE * camera.fx * RADIUS / float(centre[2]) * 2**SHIFT)
        cv2.circle(picture, _pixel(camera, centre), radius, colour, thickness, cv2.LINE_AA, SHIFT)


def _write(file: Path, picture: Picture) -> None:
    with replacing(file) as new:
        if not cv2.imwrite(str(new), picture):
            raise OSError(f"{file} cannot be written")
