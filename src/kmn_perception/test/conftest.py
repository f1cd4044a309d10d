"""What the tests of the package share."""

from __future__ import annotations

from typing import Any, NamedTuple

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from kmn_perception.configuration import resources
from kmn_perception.configuration.node_parameters import parameter_values
from kmn_perception.estimator import MorphEstimator
from kmn_perception.model.camera import Camera
from kmn_perception.model.rendering import depth_to_points
from kmn_perception.pipeline import MorphPipeline
from kmn_perception.ros.morph_node_parameters import MorphNodeSettings


class RealFrame(NamedTuple):
    """A Kinect frame: points (480, 640, 3) in the optical frame, and a label for every pixel."""

    points: NDArray[np.float32]
    labels: NDArray[np.uint8]  # 1: table, 20, 30, 40: cartons, 0: the rest


@pytest.fixture(params=range(17))
def real_frame(request: pytest.FixtureRequest) -> RealFrame:
    images: list[Any] = [
        cv2.imread(
            str(resources.share_directory() / f"data/kinect_boxes/learn{request.param}_{kind}.png"),
            cv2.IMREAD_UNCHANGED,
        )
        for kind in "dl"
    ]
    depth = np.where(images[0] > 0, images[0] / 1000.0, np.nan).astype(np.float32)
    return RealFrame(depth_to_points(depth, Camera.load("kinect_v1")), images[1])


def tabletop_pipeline() -> MorphPipeline:
    """Return the pipeline of morph_node for boxes on a table; nothing of it is compiled yet."""
    settings = MorphNodeSettings.check(parameter_values("morph_node", "morph_node_tabletop"))
    estimator = MorphEstimator.load(settings.model, settings.weights, settings.estimator)
    return MorphPipeline(estimator, settings.pipeline)


def cuboid(
    size: tuple[float, float, float], centre: tuple[float, float, float]
) -> NDArray[np.float64]:
    """Return the map (4, 4) of the unit cube to an upright cuboid, metres."""
    cube = np.diag([*size, 1.0])
    cube[:3, 3] = centre
    return cube
