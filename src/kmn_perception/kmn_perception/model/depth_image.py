"""Depth images and labels in files (PNG), as drivers and data sets keep them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

MM_PER_M = 1000.0


class PictureError(ValueError):
    """A picture that cannot be used; the text names the file and what was expected."""


def read_depth_image(file: Path) -> NDArray[np.float32]:
    """Read a depth image of 16 bits, in millimetres, 0 where nothing was measured.

    Returns
    -------
    depth
        (height, width) metres along the optical axis, NaN where nothing was measured.

    Raises
    ------
    PictureError
        If it is missing, not a picture, or of another kind.
    """
    millimetres = read_picture(file, np.uint16)
    depth = (millimetres / MM_PER_M).astype(np.float32)
    depth[millimetres == 0] = np.nan
    return depth


def read_picture(file: Path, dtype: type[np.unsignedinteger[Any]]) -> NDArray[Any]:
    """Read a picture (height, width) of one channel; raise as ``read_depth_image`` does."""
    picture = cv2.imread(str(file), cv2.IMREAD_UNCHANGED) if file.is_file() else None
    if picture is None:
        raise PictureError(f"{file} is missing, or not a picture")
    if picture.ndim != 2 or picture.dtype != dtype:
        raise PictureError(
            f"{file} is of type {picture.dtype} and shape {picture.shape}; "
            f"expected one channel of {np.dtype(dtype)}"
        )
    return picture
