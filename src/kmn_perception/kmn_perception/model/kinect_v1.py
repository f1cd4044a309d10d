"""The Kinect v1 as a depth sensor, read from ``config/sensors/kinect_v1.yaml``."""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kmn_perception.configuration import resources
from kmn_perception.configuration.settings import Fraction, NonNegative, Positive, load_settings


class DisparitySettings(NamedTuple):
    """The measurement of disparity.

    Attributes
    ----------
    baseline
        Distance of infrared camera and projector, metres.
    focal_length
        Of the infrared camera, pixels.
    step
        Disparity comes in multiples of this, pixels.
    """

    baseline: Positive
    focal_length: Positive
    step: Positive

    @property
    def scale(self) -> float:
        """Disparity times depth, pixels times metres."""
        return self.baseline * self.focal_length


class NguyenNoise(NamedTuple):
    """Axial noise ``offset + slope * (depth - centre)**2``, in m, 1/m and m.

    Of Nguyen, Izadi and Lovell, "Modeling Kinect sensor noise for improved 3D reconstruction and
    tracking", 3DIMPVT 2012.
    """

    offset: NonNegative
    slope: NonNegative
    centre: float

    def deviation(self, depth: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the standard deviation of depths, metres."""
        return self.offset + self.slope * (depth - self.centre) ** 2


class AxialSettings(NamedTuple):
    """Standard deviation of the depth along the optical axis.

    Attributes
    ----------
    nguyen
        Of one pixel of any surface, with the steps of the disparity: noise of training and
        evaluation, and weight of the references.
    khoshelham
        Before the disparity is rounded, divided by the squared depth, 1/m (Khoshelham and Elberink,
        "Accuracy and resolution of Kinect depth data", Sensors 2012): noise of the simulator.
    """

    nguyen: NguyenNoise
    khoshelham: NonNegative


class EdgeSettings(NamedTuple):
    """Disparity from which a step is an edge, pixels, and how probably a pixel there is lost."""

    step: Positive
    loss: Fraction


class ShadowSettings(NamedTuple):
    """Where the depth image, registered to the colour camera, has no measurement.

    Attributes
    ----------
    projector, infrared
        Distances of projector (to the right) and infrared camera (to the left) to the colour
        camera, metres.
    filled
        Pixels by which shadows are narrower than geometry has it.
    """

    projector: NonNegative
    infrared: NonNegative
    filled: NonNegative


class KinectV1(NamedTuple):
    """The sensor; ``lateral`` is the standard deviation of its lateral noise in pixels."""

    disparity: DisparitySettings
    lateral: NonNegative
    axial: AxialSettings
    edge: EdgeSettings
    shadow: ShadowSettings

    @classmethod
    @cache
    def load(cls) -> KinectV1:
        """Return the shipped sensor, which is read once."""
        return load_settings(cls, resources.find("config/sensors", "kinect_v1"))
