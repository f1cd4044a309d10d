"""What the tests of the package share."""

from __future__ import annotations

from typing import Any, NamedTuple

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from kmn_perception.camera import Camera
from kmn_perception.rendering import depth_to_points
from kmn_perception.resources import share_directory


class RealFrame(NamedTuple):
    """A Kinect frame: points (480, 640, 3) in the optical frame, and a label for every pixel."""

    points: NDArray[np.float32]
    labels: NDArray[np.uint8]  # 1: table, 20, 30, 40: cartons, 0: the rest


@pytest.fixture(params=range(17))
def real_frame(request: pytest.FixtureRequest) -> RealFrame:
    images: list[Any] = [
        cv2.imread(
            str(share_directory() / f"data/kinect_boxes/learn{request.param}_{kind}.png"),
            cv2.IMREAD_UNCHANGED,
        )
        for kind in "dl"
    ]
    depth = np.where(images[0] > 0, images[0] / 1000.0, np.nan).astype(np.float32)
    return RealFrame(depth_to_points(depth, Camera.load("kinect_v1")), images[1])
