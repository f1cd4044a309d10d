"""Depth images with labels, as `kinect_boxes` holds them."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

DEPTH_SUFFIX, LABEL_SUFFIX = "_d.png", "_l.png"
MM_PER_M = 1000.0
TABLE, FIRST_OBJECT = 1, 2  # labels; 0 is the rest
MIN_TABLE = 100  # pixels


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

    @property
    def objects(self) -> list[int]:
        """The labels of the objects."""
        return [int(label) for label in np.unique(self.labels) if label >= FIRST_OBJECT]


def read_frames(folder: Path) -> list[LabelledFrame]:
    """Read all ``NAME_d.png`` (16 bits, millimetres, 0 for none) with their ``NAME_l.png``.

    Raises
    ------
    FrameError
        If there are none, labels are missing, or a picture is not of the expected kind.
    """
    files = sorted(folder.glob(f"*{DEPTH_SUFFIX}"), key=_by_number)
    if not files:
        raise FrameError(f"{folder} holds no file *{DEPTH_SUFFIX}, expected depth images")
    return [_read_frame(file) for file in files]


def _by_number(file: Path) -> list[int | str]:
    return [int(part) if part.isdecimal() else part for part in re.split(r"(\d+)", file.name)]


def _read_frame(file: Path) -> LabelledFrame:
    name = file.name[: -len(DEPTH_SUFFIX)]
    millimetres = _read_picture(file, np.uint16)
    labels = _read_picture(file.with_name(name + LABEL_SUFFIX), np.uint8)
    if labels.shape != millimetres.shape:
        raise FrameError(
            f"{name}: labels of {labels.shape[1]} x {labels.shape[0]} pixels for a depth image of "
            f"{millimetres.shape[1]} x {millimetres.shape[0]}; expected the same size"
        )
    table = (labels == TABLE) & (millimetres > 0)
    if table.sum() < MIN_TABLE:
        raise FrameError(
            f"{name}: {table.sum()} measured pixels are labelled {TABLE}, expected a table of "
            f"{MIN_TABLE} or more"
        )
    depth = (millimetres / MM_PER_M).astype(np.float32)
    depth[millimetres == 0] = np.nan
    return LabelledFrame(name, depth, labels)


def _read_picture(file: Path, dtype: type[np.unsignedinteger[Any]]) -> NDArray[Any]:
    picture = cv2.imread(str(file), cv2.IMREAD_UNCHANGED) if file.is_file() else None
    if picture is None:
        raise FrameError(f"{file} is missing, or not a picture")
    if picture.ndim != 2 or picture.dtype != dtype:
        raise FrameError(
            f"{file} is of type {picture.dtype} and shape {picture.shape}; "
            f"expected one channel of {np.dtype(dtype)}"
        )
    return picture
